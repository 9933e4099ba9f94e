// hospital: parallel wings between a main hall and a corridor that joins their far ends; in each
// wing a long corridor between two rows of wards alike, with courts between the wings.
#include "sim/layout.h"

#include <algorithm>

namespace sim
{

namespace
{

// A row of rooms along a corridor: u along the corridor wall from `origin`, v away from it.
struct Frame {
    sim_point origin, u, v;

    sim_point at(double along, double deep) const
    {
        return origin + u * along + v * deep;
    }
    double angle() const
    {
        return std::atan2(u.y, u.x);
    }
};

// What all rooms of a row have in common.
struct Style {
    double door_width;
    double door_at; // m, of the middle of the door from one side of the room
    double open;    // share of doors that stand open
    double window;  // share of the outer wall that is glass
    double bath;    // m, depth of the bathroom beside the door
    int beds;
    bool mirrored; // every second room is the mirror image of its neighbour
};

struct Wing {
    double x0, x1;               // outer walls of its wards
    double left, right;          // walls of its corridor
    std::vector<sim_point> open; // just inside the wards with an open door
    double middle() const
    {
        return (left + right) / 2;
    }
};

constexpr double ward_margin = 0.25;    // m, between a side wall and a door
constexpr double bath_width = 1.6;      // m
constexpr double inside_door = 1.55;    // m, of a visit to a ward: clear of leaf and bed
constexpr double ward_clearance = 0.38; // m: its robot is larger
constexpr double passage = 1.5;         // m, through the glazed frames across corridors
constexpr int tour_places = 20, ward_visits = 4;

} // namespace

// Clean glass returns a beam only near its normal, dirty glass up to wide angles.
static double glass_of(Layout &layout)
{
    return layout.random.uniform(8, 35) * pi / 180;
}

static void put_pane(Layout &layout, sim_point a, sim_point b)
{
    layout.bodies.push_back(make_pane(a, b, glass_of(layout)));
}

static Body box_in(const Frame &frame, double along, double deep, double length, double width)
{
    return make_box(SIM_FURNITURE, frame.at(along, deep), length, width, frame.angle());
}

// The leaf of a door, closed in its frame, or open into the room.
static void put_leaf(Layout &layout, const Frame &frame, double at, double width, bool open)
{
    double angle = door_angle(layout);

    if (open)
        hang_leaf(layout, frame.at(at, 0), width, frame.u.x > 0, frame.v.x + frame.v.y > 0, angle);
    else
        layout.bodies.push_back(box_in(frame, at, 0.03, width, leaf_thickness));
}

// A wall with windows: (from, to) of each along it.
static void wall_with_panes(Layout &layout, sim_point a, sim_point b,
                            const std::vector<std::pair<double, double>> &panes,
                            std::vector<Opening> openings = {})
{
    sim_point along = (b - a) * (1 / length(b - a));

    for (auto [from, to] : panes) {
        openings.push_back({(from + to) / 2, to - from, false});
        put_pane(layout, a + along * from, a + along * to);
    }
    layout.wall(a, b, openings);
}

// A wall of panes between posts.
static void glazed_wall(Layout &layout, sim_point a, sim_point b)
{
    double whole = length(b - a);
    int count = std::max(1, (int)std::lround(whole / layout.random.uniform(1.8, 2.6)));
    std::vector<std::pair<double, double>> panes;

    panes.reserve((size_t)count);
    for (int i = 0; i < count; i++)
        panes.push_back({whole * i / count + 0.08, whole * (i + 1) / count - 0.08});
    wall_with_panes(layout, a, b, panes);
}

static void furnish_ward(Layout &layout, const Frame &frame, double from, double to, double deep,
                         const Style &style, bool mirrored)
{
    double side = mirrored ? from : to, way = mirrored ? 1 : -1; // the beds' heads are at this side
    double inner = side + way * bath_width;

    if (style.bath > 0) {
        layout.wall(frame.at(inner, 0), frame.at(inner, style.bath));
        layout.wall(frame.at(inner, style.bath), frame.at(side, style.bath));
    }
    for (int i = 0; i < style.beds; i++) {
        double v = style.bath + 0.65 + i * 1.55 + layout.random.uniform(-0.05, 0.05);

        if (v > deep - 0.6)
            break;
        layout.put(box_in(frame, side + way * 1.12, v, 2.05, 0.95), 0.02);
        layout.put(box_in(frame, side + way * 0.3, v + 0.76, 0.42, 0.4), 0.02);
    }
    side = from + to - side;
    layout.put(
        box_in(frame, side - way * 0.5, deep - 0.9 + layout.random.uniform(-0.2, 0.2), 0.7, 0.7),
        0.02);
    if (layout.random.chance(0.7))
        layout.put(box_in(frame, side - way * 0.5, deep - 1.7 + layout.random.uniform(-0.2, 0.2),
                          0.45, 0.45),
                   0.02);
}

// Rooms side by side along a corridor, their doors, windows and furniture. One of them, `station`,
// has a front of glass; the one at `hall` is open to the corridor. -1: none.
static void row_of_wards(Layout &layout, const Frame &frame, double whole, double deep, int count,
                         const Style &style, int station, int hall, std::vector<sim_point> &open)
{
    double width = whole / count;
    std::vector<Opening> doors;
    std::vector<std::pair<double, double>> fronts, windows;

    for (int i = 0; i < count; i++) {
        double from = i * width, to = from + width;
        bool mirrored = style.mirrored && i % 2 == 1;
        double at = mirrored ? to - style.door_at : from + style.door_at;
        double glass = width * style.window / 2, middle = (from + to) / 2;
        bool is_open = i == station || layout.random.chance(style.open);

        if (i > 0)
            layout.wall(frame.at(from, 0), frame.at(from, deep));
        windows.push_back({middle - glass, middle + glass});
        if (i == hall) {
            doors.push_back({middle, width - 0.3, true});
            open.push_back(frame.at(middle, deep / 2));
            continue;
        }
        doors.push_back({at, style.door_width, true});
        put_leaf(layout, frame, at, style.door_width, is_open);
        if (is_open)
            open.push_back(frame.at(at, inside_door));
        if (i == station && mirrored)
            fronts.push_back({from + 0.2, at - style.door_width / 2 - 0.2});
        else if (i == station)
            fronts.push_back({at + style.door_width / 2 + 0.2, to - 0.2});
    }
    wall_with_panes(layout, frame.at(0, 0), frame.at(whole, 0), fronts, doors);
    wall_with_panes(layout, frame.at(0, deep), frame.at(whole, deep), windows);
    for (int i = 0; i < count; i++) {
        Style own = style;

        own.bath = i == station ? 0 : style.bath;
        own.beds = i == station ? 0 : style.beds;
        if (i != hall)
            furnish_ward(layout, frame, i * width, (i + 1) * width, deep, own,
                         style.mirrored && i % 2 == 1);
    }
}

// Beds, trolleys and chairs along the walls of a corridor.
static void park(Layout &layout, const Frame &frame, double whole, double wide, int count)
{
    static const double sizes[][2] = {{2.1, 0.9}, {0.9, 0.55}, {0.5, 0.5}, {1.5, 0.5}};

    for (int i = 0; i < count; i++) {
        const double *size = sizes[layout.random.below(4)];
        double inset = wall_thickness / 2 + 0.03 + size[1] / 2;
        bool far = layout.random.chance(0.5);
        double along = layout.random.uniform(2, whole - 2);

        layout.put(box_in(frame, along, far ? wide - inset : inset, size[0], size[1]), 0.01);
    }
}

// Panes and posts at both sides of a corridor, as of a fire door that stands open.
static void frame_across(Layout &layout, const Frame &frame, double along, double wide)
{
    double light = (wide - passage) / 2;

    if (light < 0.25)
        return;
    for (bool far : {false, true}) {
        double wall = far ? wide : 0, way = far ? -1 : 1;

        put_pane(layout, frame.at(along, wall + way * 0.06),
                 frame.at(along, wall + way * (light - 0.06)));
        layout.bodies.push_back(make_box(SIM_WALL, frame.at(along, wall + way * light),
                                         wall_thickness, wall_thickness, frame.angle()));
    }
}

static Style draw_style(Layout &layout)
{
    Style style;

    style.door_width = layout.random.uniform(1.15, 1.3);
    style.door_at = wall_thickness / 2 + ward_margin + style.door_width / 2;
    style.open = layout.random.uniform(0.25, 0.55);
    style.window = layout.random.uniform(0.45, 0.75);
    style.bath = layout.random.uniform(1.6, 1.9);
    style.beds = 1 + layout.random.below(2);
    style.mirrored = layout.random.chance(0.5);
    return style;
}

static std::vector<Wing> draw_wings(Layout &layout)
{
    int most = (int)(layout.width / 13), count = std::max(2, most - layout.random.below(2));
    std::vector<Wing> wings((size_t)count);
    double used = 0, share = 0, x = 0;
    std::vector<double> courts;

    for (Wing &wing : wings) {
        double hall = layout.random.uniform(2.1, 2.7);

        wing.x0 = 0;
        wing.left = layout.random.uniform(4.3, 5.1);
        wing.right = wing.left + hall;
        wing.x1 = wing.right + layout.random.uniform(4.3, 5.1);
        used += wing.x1;
    }
    for (int i = 0; i + 1 < count; i++) {
        courts.push_back(layout.random.uniform(0.6, 1.4));
        share += courts.back();
    }
    for (int i = 0; i < count; i++) {
        Wing &wing = wings[(size_t)i];

        wing.x0 += x;
        wing.left += x;
        wing.right += x;
        wing.x1 += x;
        x = wing.x1;
        if (i + 1 < count)
            x += (layout.width - used) * courts[(size_t)i] / share;
    }
    wings.back().x1 = layout.width;
    return wings;
}

static void build_wing(Layout &layout, Wing &wing, double low, double high)
{
    Style style = draw_style(layout);
    double whole = high - low, wide = wing.right - wing.left;
    int count = std::max(1, (int)(whole / layout.random.uniform(3.4, 4.2)));
    int station = layout.random.below(count);
    bool at_left = layout.random.chance(0.5);
    Frame hall = {{wing.right, low}, {0, 1}, {-1, 0}};

    row_of_wards(layout, {{wing.left, low}, {0, 1}, {-1, 0}}, whole, wing.left - wing.x0, count,
                 style, at_left ? station : -1, -1, wing.open);
    row_of_wards(layout, {{wing.right, low}, {0, 1}, {1, 0}}, whole, wing.x1 - wing.right, count,
                 style, at_left ? -1 : station, -1, wing.open);
    frame_across(layout, hall, 0.4, wide);
    frame_across(layout, hall, whole / count * (1 + layout.random.below(std::max(1, count - 1))),
                 wide);
    park(layout, hall, whole, wide, layout.random.below(5));
}

// Points at equal distances along a polyline.
static std::vector<sim_point> along_line(const std::vector<sim_point> &line, int count)
{
    std::vector<sim_point> points;
    double whole = 0, passed = 0;

    for (size_t i = 0; i + 1 < line.size(); i++)
        whole += length(line[i + 1] - line[i]);
    for (size_t i = 0; i + 1 < line.size(); i++) {
        double leg = length(line[i + 1] - line[i]);

        while ((int)points.size() < count && whole * (double)points.size() / count < passed + leg)
            points.push_back(line[i] +
                             (line[i + 1] - line[i]) *
                                 ((whole * (double)points.size() / count - passed) / leg));
        passed += leg;
    }
    return points;
}

// Inserts a place into a tour where the detour is shortest.
static void visit(std::vector<sim_point> &tour, sim_point place)
{
    size_t best = 1;
    double shortest = 1e9;

    for (size_t i = 1; i < tour.size(); i++) {
        double detour =
            length(tour[i - 1] - place) + length(place - tour[i]) - length(tour[i - 1] - tour[i]);

        if (detour < shortest) {
            shortest = detour;
            best = i;
        }
    }
    tour.insert(tour.begin() + (ptrdiff_t)best, place);
}

// Out through one wing, back by the next, and so on; a few wards on the way are visited.
static void plan_tour(Layout &layout, const std::vector<Wing> &wings, sim_point start, double hall,
                      double link)
{
    std::vector<sim_point> line = {start, {start.x, hall}};
    std::vector<sim_point> wards;
    bool up = true;

    for (const Wing &wing : wings) {
        line.push_back({wing.middle(), up ? hall : link});
        line.push_back({wing.middle(), up ? link : hall});
        up = !up;
        wards.insert(wards.end(), wing.open.begin(), wing.open.end());
    }
    if (!up)
        line.push_back({wings.front().middle(), link});
    else
        line.push_back({start.x, hall});
    layout.places = along_line(line, tour_places);
    for (int i = 0; i < ward_visits; i++) {
        size_t share = wards.size() / ward_visits;
        sim_point ward =
            wards[(size_t)i * share + (share ? (size_t)layout.random.below((int)share) : 0)];

        visit(layout.places, ward);
    }
}

// Takes furniture away that stands on a place of the tour.
static void clear_places(Layout &layout)
{
    auto blocks = [&](const Body &body) {
        return body.kind == SIM_FURNITURE &&
               std::any_of(layout.places.begin(), layout.places.end(),
                           [&](sim_point place) { return distance(body, place) < ward_clearance; });
    };

    layout.bodies.erase(std::remove_if(layout.bodies.begin(), layout.bodies.end(), blocks),
                        layout.bodies.end());
}

void lay_out_hospital(Layout &layout)
{
    double w = layout.width, h = layout.height;
    double south = layout.random.uniform(4.2, 5), hall = south + layout.random.uniform(3, 4.5);
    double link = h - layout.random.uniform(2.1, 2.7);
    std::vector<Wing> wings = draw_wings(layout);
    Style style = draw_style(layout);
    int rooms = std::max(3, (int)(w / layout.random.uniform(3.8, 4.6))),
        entrance = 1 + layout.random.below(rooms - 2);
    std::vector<sim_point> open;
    double x = 0;

    layout.clearance = ward_clearance;
    for (double side : {0.0, w}) {
        layout.wall({side, 0}, {side, south});
        glazed_wall(layout, {side, south}, {side, hall});
        glazed_wall(layout, {side, link}, {side, h});
    }
    for (Wing &wing : wings) {
        // Between the wings there are courts, with glass toward hall and link.
        if (wing.x0 > x) {
            glazed_wall(layout, {x, hall}, {wing.x0, hall});
            glazed_wall(layout, {x, link}, {wing.x0, link});
        }
        for (double y : {hall, link}) {
            layout.wall({wing.x0, y}, {wing.left, y});
            layout.wall({wing.right, y}, {wing.x1, y});
        }
        x = wing.x1;
    }
    glazed_wall(layout, {0, h}, {w, h});
    for (Wing &wing : wings)
        build_wing(layout, wing, hall, link);
    style.bath = 0;
    row_of_wards(layout, {{0, south}, {1, 0}, {0, -1}}, w, south, rooms, style,
                 (entrance + rooms / 2) % rooms, entrance, open);
    park(layout, {{0, south}, {1, 0}, {0, 1}}, w, hall - south, 6);
    park(layout, {{0, link}, {1, 0}, {0, 1}}, w, h - link, 4);
    plan_tour(layout, wings, {w * (entrance + 0.5) / rooms, south / 2}, (south + hall) / 2,
              (link + h) / 2);
    clear_places(layout);
}

} // namespace sim
