// buildings: apartment and office: rows of rooms on a hall, doors with leaves, furniture.
#include "sim/layout.h"

#include <algorithm>

namespace sim
{

double door_angle(Layout &layout)
{
    return layout.random.uniform(1.2, 1.55);
}

void hang_door(Layout &layout, sim_point at, double width, bool along_x, bool upward)
{
    hang_leaf(layout, at, width, along_x, upward, door_angle(layout));
}

void hang_leaf(Layout &layout, sim_point at, double width, bool along_x, bool upward, double swing)
{
    double leaf = width - 0.06;
    sim_point hinge =
        along_x ? sim_point{at.x - width / 2, at.y} : sim_point{at.x, at.y - width / 2};
    double closed = along_x ? 0 : pi / 2, angle;

    // The leaf opens toward +y (a wall along x) or +x (a wall along y) when upward.
    angle = along_x == upward ? closed + swing : closed - swing;
    hinge = hinge + (along_x ? sim_point{0.02, upward ? 0.06 : -0.06}
                             : sim_point{upward ? 0.06 : -0.06, 0.02});
    layout.bodies.push_back(make_box(SIM_FURNITURE, hinge + direction(angle) * (leaf / 2), leaf,
                                     leaf_thickness, angle));
}

// A box with its back to a wall of the room: tries sides and positions until one is free.
static bool against_wall(Layout &layout, const Rect &room, double along, double deep)
{
    for (int attempt = 0; attempt < 30; attempt++) {
        int side = layout.random.below(4);
        bool along_x = side < 2;
        double span = along_x ? room.width() : room.height(),
               inset = wall_thickness / 2 + 0.015 + deep / 2;
        double from = along / 2 + 0.07, t = from + (span - 2 * from) * layout.random.unit();
        sim_point centre;

        if (span < along + 0.2)
            continue;
        if (along_x)
            centre = {room.x0 + t, side == 0 ? room.y0 + inset : room.y1 - inset};
        else
            centre = {side == 2 ? room.x0 + inset : room.x1 - inset, room.y0 + t};
        if (layout.put(make_box(SIM_FURNITURE, centre, along, deep, along_x ? 0 : pi / 2), 0.008))
            return true;
    }
    return false;
}

static bool in_the_open(Layout &layout, const Rect &room, double along, double across,
                        double room_about)
{
    for (int attempt = 0; attempt < 30; attempt++) {
        double x = layout.random.uniform(room.x0, room.x1),
               y = layout.random.uniform(room.y0, room.y1);
        double angle = layout.random.uniform(-0.15, 0.15);

        if (layout.put(make_box(SIM_FURNITURE, {x, y}, along, across, angle), room_about))
            return true;
    }
    return false;
}

// Up to `count` chairs about the body that was put last, some pushed in, some turned away.
static void chairs_about(Layout &layout, const Rect &room, int count)
{
    Body table = layout.bodies.back();
    double x = table.vertices[2].x, y = table.vertices[2].y;

    for (int i = 0; i < count; i++) {
        double off = 0.26 + layout.random.uniform(0.02, 0.2),
               along = layout.random.uniform(-0.7, 0.7);
        double angle = table.angle + layout.random.uniform(-0.5, 0.5);
        sim_point at = i % 2 ? sim_point{along * x, i % 4 == 1 ? y + off : -y - off}
                             : sim_point{i % 4 == 0 ? x + off : -x - off, along * y};

        at = table.centre + turned(at, table.angle);
        if (at.x > room.x0 + 0.35 && at.x < room.x1 - 0.35 && at.y > room.y0 + 0.35 &&
            at.y < room.y1 - 0.35)
            layout.put(make_box(SIM_FURNITURE, at, 0.42, 0.42, angle), 0.01);
    }
}

void furnish(Layout &layout, const Rect &room, Use use)
{
    switch (use) {
    case Use::living:
        against_wall(layout, room, 2.1, 0.9);
        against_wall(layout, room, 1.6, 0.4);
        against_wall(layout, room, 0.9, 0.9);
        if (in_the_open(layout, room, 1.1, 0.6, 0.65))
            chairs_about(layout, room, 1);
        break;
    case Use::kitchen:
        against_wall(layout, room, 2.4, 0.6);
        against_wall(layout, room, 0.65, 0.65);
        if (in_the_open(layout, room, 1.3, 0.8, 0.7))
            chairs_about(layout, room, 4);
        break;
    case Use::bedroom:
        against_wall(layout, room, 1.5, 2.0);
        against_wall(layout, room, 1.6, 0.6);
        against_wall(layout, room, 0.45, 0.45);
        if (against_wall(layout, room, 1.1, 0.6))
            chairs_about(layout, room, 4);
        break;
    case Use::bath:
        against_wall(layout, room, 1.7, 0.75);
        against_wall(layout, room, 0.6, 0.45);
        against_wall(layout, room, 0.4, 0.6);
        break;
    case Use::study:
        if (against_wall(layout, room, 1.5, 0.75))
            chairs_about(layout, room, 4);
        against_wall(layout, room, 1.0, 0.35);
        against_wall(layout, room, 1.4, 0.4);
        if (in_the_open(layout, room, 1.2, 0.7, 0.8))
            chairs_about(layout, room, 3);
        break;
    case Use::office:
        if (against_wall(layout, room, 1.6, 0.8))
            chairs_about(layout, room, 4);
        if (against_wall(layout, room, 1.6, 0.8))
            chairs_about(layout, room, 4);
        against_wall(layout, room, 1.2, 0.45);
        against_wall(layout, room, 0.45, 0.6);
        break;
    case Use::store:
        against_wall(layout, room, 1.2, 0.5);
        against_wall(layout, room, 0.8, 0.5);
        break;
    }
}

namespace
{
struct Cell {
    double share; // of the row's length
    Use use;
};
} // namespace

// Rooms side by side along x, with doors in the wall at `hall` (their lower or upper side).
static void row_of_rooms(Layout &layout, const Rect &row, std::vector<Cell> cells, bool hall_below)
{
    std::vector<Opening> openings;
    std::vector<Rect> rooms;
    double whole = 0, x = row.x0, wall = hall_below ? row.y0 : row.y1;

    for (size_t i = cells.size(); i > 1; i--)
        std::swap(cells[i - 1], cells[(size_t)layout.random.below((int)i)]);
    for (Cell &cell : cells) {
        cell.share *= layout.random.uniform(0.92, 1.08);
        whole += cell.share;
    }
    for (size_t i = 0; i < cells.size(); i++) {
        double next = i + 1 == cells.size() ? row.x1 : x + row.width() * cells[i].share / whole;

        rooms.push_back({x, row.y0, next, row.y1});
        if (i > 0)
            layout.wall({x, row.y0}, {x, row.y1});
        x = next;
    }
    for (const Rect &room : rooms) {
        double width = layout.random.uniform(0.9, 1.0), margin = 0.25 + width / 2;

        openings.push_back(
            {layout.random.uniform(room.x0 + margin, room.x1 - margin) - row.x0, width, true});
    }
    layout.wall({row.x0, wall}, {row.x1, wall}, openings);
    for (const Opening &opening : openings)
        if (layout.random.chance(0.7))
            hang_door(layout, {row.x0 + opening.at, wall}, opening.width, true, hall_below);
    for (size_t i = 0; i < rooms.size(); i++)
        furnish(layout, rooms[i], cells[i].use);
}

void lay_out_apartment(Layout &layout)
{
    double w = layout.width, h = layout.height, low = 0.42 * h, high = low + 1.3;
    Rect whole = {0, 0, w, h};

    layout.walls(whole);
    row_of_rooms(layout, {0, high, w, h},
                 {{6, Use::living}, {4, Use::kitchen}, {2.6, Use::bath}, {3.6, Use::study}}, true);
    row_of_rooms(layout, {0, 0, w, low},
                 {{4.4, Use::bedroom}, {4.2, Use::bedroom}, {4.2, Use::study}, {2.4, Use::store}},
                 false);
    against_wall(layout, {0, low, w, high}, 0.9, 0.25);
    for (int i = 0; i < 8; i++) {
        double x = layout.loose.uniform(0, w), y = layout.loose.uniform(0, h);

        layout.heap(whole, {x, y}, 0.2, 1, false);
    }
}

void lay_out_office(Layout &layout)
{
    double w = layout.width, h = layout.height, deep = 0.27 * h, hall = 1.6;
    double left = deep, right = w - deep, low = deep, high = h - deep;
    Rect core = {left + hall, low + hall, right - hall, high - hall};
    int across = std::max(2, (int)std::lround((right - left) / 3.8));
    std::vector<Cell> rooms((size_t)across, {1, Use::office});

    layout.walls({0, 0, w, h});
    // Rooms above and below the loop; those in the corners of the building belong to the sides.
    for (double x : {left, right}) {
        layout.wall({x, 0}, {x, low});
        layout.wall({x, high}, {x, h});
    }
    row_of_rooms(layout, {left, high, right, h}, rooms, true);
    row_of_rooms(layout, {left, 0, right, low}, rooms, false);
    for (bool at_left : {true, false}) {
        double x = at_left ? left : right, middle = h / 2 + layout.random.uniform(-0.4, 0.4);
        double outer = at_left ? 0 : w;
        std::vector<Opening> openings;
        Rect lower = {std::min(x, outer), 0, std::max(x, outer), middle};
        Rect upper = {std::min(x, outer), middle, std::max(x, outer), h};

        for (double at : {layout.random.uniform(0.8, middle - low - 0.8),
                          layout.random.uniform(middle - low + 0.8, high - low - 0.8)})
            openings.push_back({at, 0.95, true});
        layout.wall({std::min(x, outer), middle}, {std::max(x, outer), middle});
        layout.wall({x, low}, {x, high}, openings);
        for (const Opening &opening : openings)
            if (layout.random.chance(0.7))
                hang_door(layout, {x, low + opening.at}, opening.width, false, !at_left);
        furnish(layout, lower, Use::office);
        furnish(layout, lower, Use::store);
        furnish(layout, upper, Use::office);
        furnish(layout, upper, Use::store);
    }
    // Two rooms inside the loop.
    double split = core.x0 + core.width() * layout.random.uniform(0.4, 0.6);
    double lower_door = layout.random.uniform(0.8, split - core.x0 - 0.8);
    double upper_door = layout.random.uniform(split - core.x0 + 0.8, core.width() - 0.8);

    layout.wall({core.x0, core.y0}, {core.x0, core.y1});
    layout.wall({core.x1, core.y0}, {core.x1, core.y1});
    layout.wall({split, core.y0}, {split, core.y1});
    layout.wall({core.x0, core.y0}, {core.x1, core.y0}, {{lower_door, 1.0, true}});
    layout.wall({core.x0, core.y1}, {core.x1, core.y1}, {{upper_door, 1.0, true}});
    hang_door(layout, {core.x0 + lower_door, core.y0}, 1.0, true, true);
    furnish(layout, {core.x0, core.y0, split, core.y1}, Use::kitchen);
    furnish(layout, {split, core.y0, core.x1, core.y1}, Use::store);
    against_wall(layout, {left, low, right, high}, 0.9, 0.3);
}

} // namespace sim
