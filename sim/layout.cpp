#include "sim/layout.h"

#include <algorithm>

namespace sim
{

double Body::reach() const
{
    double reach = radius;

    for (sim_point v : vertices)
        reach = std::max(reach, length(v));
    return reach;
}

std::vector<sim_point> Body::outline() const
{
    std::vector<sim_point> outline;
    sim_point axis = direction(angle);

    outline.reserve(vertices.size());
    for (sim_point v : vertices)
        outline.push_back(centre + turned(v, axis));
    return outline;
}

Body make_box(sim_kind kind, sim_point centre, double along, double across, double angle)
{
    double x = along / 2, y = across / 2;

    return {kind, centre, angle, 0, {{-x, -y}, {x, -y}, {x, y}, {-x, y}}, false};
}

Body make_disc(sim_kind kind, sim_point centre, double radius)
{
    return {kind, centre, 0, radius, {}, true};
}

Body make_pane(sim_point a, sim_point b, double glass)
{
    sim_point along = b - a;
    Body pane = make_box(SIM_GLASS, (a + b) * 0.5, length(along), pane_thickness,
                         std::atan2(along.y, along.x));

    pane.glass = glass;
    return pane;
}

Outline::Outline(const Body &body) : radius(body.radius), vertices(body.outline())
{
    if (radius > 0)
        vertices.push_back(body.centre);
}

double Outline::distance(sim_point point) const
{
    double nearest = 1e18; // squared
    bool outside = false;

    if (radius > 0)
        return length(point - vertices[0]) - radius;
    for (size_t i = 0; i < vertices.size(); i++) {
        sim_point a = vertices[i], side = vertices[i + 1 < vertices.size() ? i + 1 : 0] - a,
                  from_a = point - a;
        double t = std::clamp(dot(from_a, side) / dot(side, side), 0.0, 1.0);
        sim_point apart = from_a - side * t;

        outside = outside || cross(from_a, side) > 0;
        nearest = std::min(nearest, dot(apart, apart));
    }
    return outside ? std::sqrt(nearest) : -std::sqrt(nearest);
}

double distance(const Body &body, sim_point point)
{
    return Outline(body).distance(point);
}

// Returns the largest separation along the side normals of `a` (separating axis test).
static double gap_by_sides(const std::vector<sim_point> &a, const std::vector<sim_point> &b)
{
    double widest = -1e9;

    for (size_t i = 0; i < a.size(); i++) {
        sim_point side = a[(i + 1) % a.size()] - a[i];
        double nearest = 1e9;

        for (sim_point p : b)
            nearest = std::min(nearest, cross(p - a[i], side) / length(side));
        widest = std::max(widest, nearest);
    }
    return widest;
}

double gap(const Body &a, const Body &b)
{
    std::vector<sim_point> first, second;

    if (a.radius > 0)
        return distance(b, a.centre) - a.radius;
    if (b.radius > 0)
        return distance(a, b.centre) - b.radius;
    first = a.outline();
    second = b.outline();
    return std::max(gap_by_sides(first, second), gap_by_sides(second, first));
}

// A straight piece from a to b, lengthened at its ends by `at_a` and `at_b`.
static Body piece(sim_point a, sim_point b, double at_a, double at_b)
{
    sim_point along = (b - a) * (1 / length(b - a));
    sim_point from = a - along * at_a, to = b + along * at_b;

    return make_box(SIM_WALL, (from + to) * 0.5, length(to - from), wall_thickness,
                    std::atan2(along.y, along.x));
}

void Layout::wall(sim_point a, sim_point b, std::vector<Opening> openings)
{
    double whole = length(b - a), from = 0;
    sim_point along = (b - a) * (1 / whole);

    std::sort(openings.begin(), openings.end(),
              [](const Opening &p, const Opening &q) { return p.at < q.at; });
    for (const Opening &opening : openings) {
        double end = opening.at - opening.width / 2;

        if (opening.door)
            doors.push_back(a + along * opening.at);
        if (end - from > 0.02)
            bodies.push_back(
                piece(a + along * from, a + along * end, from > 0 ? 0 : wall_overlap, 0));
        from = std::max(from, opening.at + opening.width / 2);
    }
    if (whole - from > 0.02)
        bodies.push_back(piece(a + along * from, b, from > 0 ? 0 : wall_overlap, wall_overlap));
}

void Layout::walls(const Rect &rect)
{
    wall({rect.x0, rect.y0}, {rect.x1, rect.y0});
    wall({rect.x1, rect.y0}, {rect.x1, rect.y1});
    wall({rect.x1, rect.y1}, {rect.x0, rect.y1});
    wall({rect.x0, rect.y1}, {rect.x0, rect.y0});
}

void Layout::curve(const std::vector<sim_point> &points)
{
    for (size_t i = 0; i + 1 < points.size(); i++) {
        bodies.push_back(piece(points[i], points[i + 1], 0.01, 0.01));
        bodies.back().curved = true;
    }
}

bool Layout::near_door(sim_point p, double reach) const
{
    for (sim_point door : doors)
        if (length(p - door) < reach)
            return true;
    return false;
}

bool Layout::put(const Body &body, double room)
{
    for (sim_point door : doors)
        if (distance(body, door) < 0.65)
            return false;
    for (const Body &other : bodies)
        if (length(other.centre - body.centre) < other.reach() + body.reach() + room &&
            gap(other, body) < room)
            return false;
    bodies.push_back(body);
    return true;
}

// Adds a loose body with its centre inside the rectangle and clear of doors.
void Layout::scatter(const Rect &within, Body body)
{
    double reach = body.reach() + wall_thickness;

    body.centre.x = std::clamp(body.centre.x, within.x0 + reach,
                               std::max(within.x0 + reach, within.x1 - reach));
    body.centre.y = std::clamp(body.centre.y, within.y0 + reach,
                               std::max(within.y0 + reach, within.y1 - reach));
    if (!near_door(body.centre, 0.5 + body.reach()))
        bodies.push_back(body);
}

// A stone: vertices at random angles on a circle, so that the polygon is convex.
static Body stone(Random &random, sim_point centre, double size, bool round)
{
    Body body = {SIM_RUBBLE, centre, random.uniform(-pi, pi), 0, {}, round};
    int count = round ? 8 : 4 + random.below(4);

    for (int i = 0; i < count; i++) {
        double uneven = round ? 0 : random.uniform(-0.35, 0.35);

        body.vertices.push_back(direction(2 * pi * (i + uneven) / count) * (size / 2));
    }
    return body;
}

void Layout::heap(const Rect &within, sim_point middle, double spread, int count, bool round)
{
    count = (int)std::lround(count * rubble);
    for (int i = 0; i < count; i++) {
        double x = loose.normal(), y = loose.normal();
        sim_point at = middle + sim_point{x, y} * spread;
        double size = loose.uniform(0.12, 0.42), slim = loose.uniform(0.35, 1);
        int sort = loose.below(3);

        if (round && sort > 0)
            scatter(within, make_disc(SIM_RUBBLE, at, size / 2));
        else if (round || sort > 0)
            scatter(within, stone(loose, at, size, round));
        else
            scatter(within, make_box(SIM_RUBBLE, at, size, size * slim, loose.uniform(-pi, pi)));
    }
}

void Layout::box_about(const Rect &within)
{
    double x = loose.uniform(within.x0, within.x1), y = loose.uniform(within.y0, within.y1);
    double along = loose.uniform(0.3, 0.8), across = loose.uniform(0.3, 0.6),
           angle = loose.uniform(-pi, pi);

    if (loose.chance(rubble / 1.5))
        scatter(within, make_box(SIM_BOX, {x, y}, along, across, angle));
}

void Layout::fallen_wall(const Rect &within, sim_point middle, int count)
{
    count = (int)std::lround(count * rubble);
    for (int i = 0; i < count; i++) {
        double x = loose.uniform(-0.6, 0.6), y = loose.uniform(-0.6, 0.6);
        double size = loose.uniform(0.4, 1.0), angle = loose.uniform(-pi, pi);

        scatter(within,
                make_box(SIM_RUBBLE, middle + sim_point{x, y}, size, wall_thickness, angle));
    }
}

void turn(Layout &layout, double angle)
{
    sim_point middle = {layout.width / 2, layout.height / 2};

    for (Body &body : layout.bodies) {
        body.centre = turned(body.centre - middle, angle);
        body.angle = wrap(body.angle + angle);
    }
    for (sim_point &door : layout.doors)
        door = turned(door - middle, angle);
    for (sim_point &place : layout.places)
        place = turned(place - middle, angle);
}

} // namespace sim
