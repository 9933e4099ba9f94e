// scenes: rescue, maze, round and the four plain ones. Furnished buildings are in buildings.cpp.
#include "sim/layout.h"

#include <algorithm>

namespace sim
{

namespace
{
// A wall that splits a room, with the positions of later walls that meet it.
struct Split {
    sim_point a, b;
    std::vector<double> joints;
};

bool on_segment(const Split &split, sim_point p)
{
    sim_point along = split.b - split.a;
    double whole = length(along), t = dot(p - split.a, along) / whole;

    return t > 0.01 && t < whole - 0.01 && std::abs(cross(along, p - split.a)) / whole < 0.01;
}
} // namespace

// Rooms by splitting the longer side again and again, until none can be split into sides of at
// least `smallest`.
static std::vector<Rect> divide(Random &random, Rect whole, double smallest,
                                std::vector<Split> &splits)
{
    std::vector<Rect> open = {whole}, rooms;

    while (!open.empty()) {
        Rect room = open.back(), other = room;
        double ratio = room.width() / room.height();
        bool upright =
            ratio > 1.25 || (ratio > 0.8 && random.chance(0.5)); // the new wall stands along y
        double side = upright ? room.width() : room.height();
        Split split;

        open.pop_back();
        if (side < 2 * smallest) {
            rooms.push_back(room);
            continue;
        }
        double share =
            random.uniform(std::max(0.38, smallest / side), std::min(0.62, 1 - smallest / side));
        if (upright) {
            room.x1 = other.x0 = room.x0 + share * side;
            split = {{room.x1, room.y0}, {room.x1, room.y1}, {}};
        } else {
            room.y1 = other.y0 = room.y0 + share * side;
            split = {{room.x0, room.y1}, {room.x1, room.y1}, {}};
        }
        for (Split &earlier : splits)
            for (sim_point end : {split.a, split.b})
                if (on_segment(earlier, end))
                    earlier.joints.push_back(length(end - earlier.a));
        splits.push_back(split);
        open.push_back(room);
        open.push_back(other);
    }
    return rooms;
}

// Openings for a wall: one door at least, in the stretches between the walls that meet it. Long
// stretches without a door may have come down in part.
static std::vector<Opening> open_up(Layout &layout, Split &split, std::vector<sim_point> &breaks)
{
    std::vector<Opening> openings;
    std::vector<std::pair<double, double>> stretches;
    double from = 0, whole = length(split.b - split.a);

    std::sort(split.joints.begin(), split.joints.end());
    split.joints.push_back(whole);
    for (double joint : split.joints) {
        if (joint - from > 1.6)
            stretches.push_back({from, joint});
        from = joint;
    }
    size_t first = (size_t)layout.random.below((int)stretches.size());
    for (size_t k = 0; k < stretches.size(); k++) {
        auto [low, high] = stretches[(first + k) % stretches.size()];
        bool door = k == 0 || layout.random.chance(0.35),
             fallen = !door && layout.random.chance(0.7);
        double width = fallen ? layout.random.uniform(0.9, 1.6) : layout.random.uniform(0.95, 1.2);
        double edge = std::min(0.5, (high - low - width) / 2), room = high - low - width - 2 * edge;
        double at = low + edge + width / 2 + room * layout.random.unit();

        if (door || (fallen && room > 0))
            openings.push_back({at, width, door});
        if (fallen && room > 0)
            breaks.push_back(split.a + (split.b - split.a) * (at / whole));
    }
    return openings;
}

void lay_out_rescue(Layout &layout)
{
    Rect whole = {0, 0, layout.width, layout.height};
    std::vector<Split> splits;
    std::vector<Rect> rooms = divide(layout.random, whole, 2.5, splits);
    std::vector<sim_point> breaks;

    layout.walls(whole);
    for (Split &split : splits)
        layout.wall(split.a, split.b, open_up(layout, split, breaks));
    for (const Rect &room : rooms) {
        sim_point middle = room.middle();
        double slant = layout.random.uniform(-pi, pi), size = layout.random.uniform(0.9, 1.6);
        double x = layout.random.uniform(-0.2, 0.2), y = layout.random.uniform(-0.2, 0.2);

        // Some rooms have an oblique partition.
        if (layout.random.chance(0.45))
            layout.put(make_box(SIM_WALL, middle + sim_point{x * room.width(), y * room.height()},
                                size, wall_thickness, slant),
                       0.6);
    }
    for (sim_point at : breaks)
        layout.fallen_wall(whole, at, 3);
    for (const Rect &room : rooms) {
        double x = layout.loose.uniform(room.x0, room.x1),
               y = layout.loose.uniform(room.y0, room.y1);

        layout.heap(room, {x, y}, 0.4, 3 + layout.loose.below(6), false);
        layout.box_about(room);
        layout.box_about(room);
        layout.heap(room, room.middle(), 1.2, 2, false);
    }
}

void lay_out_maze(Layout &layout)
{
    int columns = std::max(2, (int)std::lround(layout.width / 1.25));
    int rows = std::max(2, (int)std::lround(layout.height / 1.25));
    double dx = layout.width / columns, dy = layout.height / rows;
    std::vector<char> right((size_t)(columns * rows), 1), up(right),
        seen((size_t)(columns * rows), 0); // walls
    std::vector<int> stack = {0};
    Rect whole = {0, 0, layout.width, layout.height};

    seen[0] = 1;
    while (!stack.empty()) {
        int cell = stack.back(), c = cell % columns, r = cell / columns, free_sides[4], sides = 0;

        for (int side = 0; side < 4; side++) {
            int nc = c + (side == 0) - (side == 1), nr = r + (side == 2) - (side == 3);

            if (nc >= 0 && nr >= 0 && nc < columns && nr < rows &&
                !seen[(size_t)(nr * columns + nc)])
                free_sides[sides++] = side;
        }
        if (sides == 0) {
            stack.pop_back();
            continue;
        }
        int side = free_sides[layout.random.below(sides)];
        int next = cell + (side == 0) - (side == 1) + columns * ((side == 2) - (side == 3));

        (side < 2 ? right : up)[(size_t)std::min(cell, next)] = 0;
        seen[(size_t)next] = 1;
        stack.push_back(next);
    }
    for (size_t i = 0; i < right.size(); i++) { // loops
        if (layout.random.chance(0.14))
            right[i] = 0;
        if (layout.random.chance(0.14))
            up[i] = 0;
    }
    layout.walls(whole);
    for (int c = 0; c + 1 < columns; c++)
        for (int r = 0, from = 0; r < rows; r++) {
            bool wall = right[(size_t)(r * columns + c)],
                 last = r + 1 == rows || !right[(size_t)((r + 1) * columns + c)];

            if (!wall)
                from = r + 1;
            else if (last)
                layout.wall({(c + 1) * dx, from * dy}, {(c + 1) * dx, (r + 1) * dy});
        }
    for (int r = 0; r + 1 < rows; r++)
        for (int c = 0, from = 0; c < columns; c++) {
            bool wall = up[(size_t)(r * columns + c)],
                 last = c + 1 == columns || !up[(size_t)(r * columns + c + 1)];

            if (!wall)
                from = c + 1;
            else if (last)
                layout.wall({from * dx, (r + 1) * dy}, {(c + 1) * dx, (r + 1) * dy});
        }
    for (int i = 0; i < columns * rows / 8; i++) {
        double x = layout.loose.uniform(0, layout.width),
               y = layout.loose.uniform(0, layout.height);

        layout.heap(whole, {x, y}, 0.05, 1, false);
    }
}

// Four rooms, a hallway between the upper and the lower two. One sensor in each of three rooms, one
// in the hallway, and one before the door of the lower right room, which has a view of three of its
// sides.
void lay_out_rooms(Layout &layout)
{
    double w = layout.width, h = layout.height, low = 0.4 * h, high = 0.6 * h;
    double top = w * layout.random.uniform(0.44, 0.54),
           bottom = w * layout.random.uniform(0.46, 0.58);
    double doors[4];

    for (double &door : doors)
        door = layout.random.uniform(0.3, 0.7);
    doors[0] = top * doors[0];
    doors[1] = top + (w - top) * doors[1];
    doors[2] = bottom * doors[2];
    doors[3] = bottom + (w - bottom) * doors[3];
    layout.walls({0, 0, w, h});
    layout.wall({top, high}, {top, h});
    layout.wall({bottom, 0}, {bottom, low});
    layout.wall({0, high}, {w, high}, {{doors[0], 1.0, true}, {doors[1], 1.0, true}});
    layout.wall({0, low}, {w, low}, {{doors[2], 1.0, true}, {doors[3], 1.0, true}});
    layout.places = {{doors[2], 0.25 * h},
                     {doors[0], 0.75 * h},
                     {w * 0.35, 0.5 * h},
                     {doors[1], 0.75 * h},
                     {doors[3], low + 0.15}};
}

void lay_out_corridor(Layout &layout)
{
    layout.walls({0, 0, layout.width, layout.height});
}

void lay_out_twins(Layout &layout)
{
    double w = layout.width, h = layout.height, hall = 1.5, room = 0.36 * w;
    double door = room * layout.random.uniform(0.3, 0.7), shift = w - room;
    size_t first, doors = layout.doors.size();

    layout.wall({0, 0}, {w, 0});
    layout.wall({0, 0}, {0, hall});
    layout.wall({w, 0}, {w, hall});
    layout.wall({room, hall}, {shift, hall});
    layout.wall({room, h}, {shift, h});
    first = layout.bodies.size();
    layout.wall({0, hall}, {room, hall}, {{door, 1.0, true}});
    layout.wall({0, hall}, {0, h});
    layout.wall({room, hall}, {room, h});
    layout.wall({0, h}, {room, h});
    furnish(layout, {0, hall, room, h}, Use::study);
    // The other room is the same, moved.
    for (size_t i = first, end = layout.bodies.size(); i < end; i++) {
        Body copy = layout.bodies[i];

        copy.centre.x += shift;
        layout.bodies.push_back(copy);
    }
    for (size_t i = doors, end = layout.doors.size(); i < end; i++)
        layout.doors.push_back(layout.doors[i] + sim_point{shift, 0});
}

void lay_out_joined(Layout &layout)
{
    double w = layout.width, h = layout.height, wall = w * layout.random.uniform(0.42, 0.58),
           door = h * layout.random.uniform(0.2, 0.8);

    layout.walls({0, 0, w, h});
    layout.wall({wall, 0}, {wall, h}, {{door, 1.0, true}});
    furnish(layout, {0, 0, wall, h}, Use::study);
    furnish(layout, {wall, 0, w, h}, Use::living);
}

void lay_out_mirror(Layout &layout)
{
    double w = layout.width, h = layout.height, hall = 1.5, inner = w / 2 - hall / 2;
    double cut = (h - 3 * hall) * layout.random.uniform(0.35, 0.65) + hall;
    Rect blocks[] = {{hall, hall, inner, cut}, {hall, cut + hall, inner, h - hall}};
    size_t first;

    layout.walls({0, 0, w, h});
    first = layout.bodies.size();
    for (const Rect &block : blocks) {
        // A notch in one long side of each block makes its corridor distinguishable from the next.
        double from = block.x0 + block.width() * layout.random.uniform(0.2, 0.5), to = from + 0.9;
        bool above = layout.random.chance(0.5);
        double y = above ? block.y1 : block.y0, depth = above ? -0.6 : 0.6,
               other = above ? block.y0 : block.y1;

        layout.wall({block.x0, other}, {block.x1, other});
        layout.wall({block.x0, block.y0}, {block.x0, block.y1});
        layout.wall({block.x1, block.y0}, {block.x1, block.y1});
        layout.wall({block.x0, y}, {from, y});
        layout.wall({from, y}, {from, y + depth});
        layout.wall({from, y + depth}, {to, y + depth});
        layout.wall({to, y + depth}, {to, y});
        layout.wall({to, y}, {block.x1, y});
    }
    for (int i = 0; i < 3; i++) {
        double y = layout.random.uniform(0.15, 0.85) * h, size = layout.random.uniform(0.2, 0.35);

        layout.put(make_box(SIM_FURNITURE, {0.08 + size / 2, y}, size, size, 0), 0.02);
    }
    for (size_t i = first, end = layout.bodies.size(); i < end; i++) {
        Body copy = layout.bodies[i];

        copy.centre.x = w - copy.centre.x;
        copy.angle = wrap(pi - copy.angle); // boxes are their own mirror images
        layout.bodies.push_back(copy);
    }
}

void lay_out_round(Layout &layout)
{
    double w = layout.width, h = layout.height, phase = layout.random.uniform(-pi, pi);
    double wave = layout.random.uniform(0.03, 0.06);
    std::vector<sim_point> ring;
    Rect whole = {0, 0, w, h};
    int sides = (int)std::lround((w + h) * 3.2);

    for (int i = 0; i <= sides; i++) {
        double angle = 2 * pi * i / sides, r = 1 - wave + wave * std::cos(3 * angle + phase);

        ring.push_back({w / 2 * (1 + r * std::cos(angle)), h / 2 * (1 + r * std::sin(angle))});
    }
    layout.curve(ring);
    for (int i = 0, arcs = 0; i < 60 && arcs < 3; i++) {
        double x = layout.random.uniform(0.25, 0.75) * w, y = layout.random.uniform(0.25, 0.75) * h;
        double r = layout.random.uniform(0.09, 0.17) * w, from = layout.random.uniform(-pi, pi);
        double span = layout.random.uniform(2, 3.6);
        int count = (int)std::ceil(span * r / 0.22);
        std::vector<sim_point> arc;
        bool clear = true;

        for (int k = 0; k <= count; k++)
            arc.push_back(sim_point{x, y} + direction(from + span * k / count) * r);
        for (const Body &body : layout.bodies)
            for (sim_point p : arc)
                clear = clear && distance(body, p) > 0.9;
        if (!clear)
            continue;
        layout.curve(arc);
        arcs++;
    }
    for (int i = 0, pillars = 0; i < 80 && pillars < 6; i++) {
        double x = layout.random.uniform(0.1, 0.9) * w, y = layout.random.uniform(0.1, 0.9) * h;
        double size = layout.random.uniform(0.2, 0.5), u = 2 * x / w - 1, v = 2 * y / h - 1;

        if (u * u + v * v < 0.6)
            pillars += layout.put(make_disc(SIM_FURNITURE, {x, y}, size), 0.75);
    }
    for (int i = 0; i < 5; i++) {
        double angle = layout.loose.uniform(-pi, pi), r = layout.loose.uniform(0.1, 0.75);

        layout.heap(whole, {w / 2 * (1 + r * std::cos(angle)), h / 2 * (1 + r * std::sin(angle))},
                    0.4, 7, true);
    }
}

} // namespace sim
