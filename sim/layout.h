// layout: the bodies of a scene during its construction, in the frame of the scene: (0, 0) lower
// left, (width, height) upper right; later rotated into the world.
#ifndef CAIRN_SIM_LAYOUT_H
#define CAIRN_SIM_LAYOUT_H

#include <vector>

#include "sim/numbers.h"

namespace sim
{

constexpr double wall_thickness = 0.1;
constexpr double free_clearance = 0.3; // m, of a robot
constexpr double pane_thickness = 0.03;
constexpr double leaf_thickness = 0.04; // of a door
// Extension of a wall beyond its ends, m: less than half the thickness, so that faces of joined
// walls do not coincide.
constexpr double wall_overlap = 0.048;

// A convex polygon (at most 8 vertices, counter-clockwise about its centre) or a disc.
struct Body {
    sim_kind kind;
    sim_point centre;
    double angle;
    double radius; // 0: a polygon
    std::vector<sim_point> vertices;
    bool curved;
    double glass = 0; // rad, of a pane: angle of incidence up to which a beam returns

    double reach() const;                   // radius of the bounding circle about the centre
    std::vector<sim_point> outline() const; // vertices in the frame of the layout; empty for a disc
    bool loose() const
    {
        return kind == SIM_BOX || kind == SIM_RUBBLE;
    }
};

Body make_box(sim_kind kind, sim_point centre, double along, double across, double angle);
Body make_disc(sim_kind kind, sim_point centre, double radius);
// A pane of glass from a to b that returns beams up to the angle of incidence `glass`.
Body make_pane(sim_point a, sim_point b, double glass);

// Precomputed outline of a body, for repeated distance queries.
class Outline
{
  public:
    explicit Outline(const Body &body);
    double distance(sim_point point) const; // signed distance, negative inside

  private:
    double radius;
    std::vector<sim_point> vertices; // the centre of a disc
};

double distance(const Body &body, sim_point point); // the same for a single query

// Returns the signed gap between two bodies in m: minus the penetration depth (separating axis
// test) when they overlap, else a lower bound of the distance.
double gap(const Body &a, const Body &b);

struct Rect {
    double x0, y0, x1, y1;
    double width() const
    {
        return x1 - x0;
    }
    double height() const
    {
        return y1 - y0;
    }
    sim_point middle() const
    {
        return {(x0 + x1) / 2, (y0 + y1) / 2};
    }
};

// An opening in a wall, centred `at` metres along the wall.
struct Opening {
    double at, width;
    bool door; // kept clear of loose bodies and furniture
};

class Layout
{
  public:
    Layout(double w, double h, double rubble_amount, uint64_t seed)
        : width(w), height(h), rubble(rubble_amount), random(seed, layout_stream),
          loose(seed, rubble_stream)
    {
    }

    double width, height;
    double rubble;
    double clearance = free_clearance; // m, of places and ways
    std::vector<Body> bodies;
    std::vector<sim_point> doors;
    std::vector<sim_point>
        places;    // given by the scene, in the order of the tour; further places are chosen
    Random random; // for static bodies
    Random loose;  // for loose bodies

    void wall(sim_point a, sim_point b, std::vector<Opening> openings = {});
    void walls(const Rect &rect);
    // Adds walls along a polyline that approximates a curve.
    void curve(const std::vector<sim_point> &points);
    // Adds furniture unless its distance to a body or to the passage of a door is less than `room`.
    bool put(const Body &body, double room);
    // Scatters `count` pieces around the middle with standard deviation `spread`; they may overlap
    // before settling.
    void heap(const Rect &within, sim_point middle, double spread, int count, bool round);
    void box_about(const Rect &within);
    // Scatters the pieces of a collapsed wall.
    void fallen_wall(const Rect &within, sim_point middle, int count);
    bool near_door(sim_point p, double reach) const;

  private:
    void scatter(const Rect &within, Body body);
};

// Scenes.
void lay_out_rescue(Layout &layout);
void lay_out_maze(Layout &layout);
void lay_out_rooms(Layout &layout);
void lay_out_apartment(Layout &layout);
void lay_out_office(Layout &layout);
void lay_out_corridor(Layout &layout);
void lay_out_twins(Layout &layout);
void lay_out_mirror(Layout &layout);
void lay_out_round(Layout &layout);
void lay_out_hospital(Layout &layout);
void lay_out_joined(Layout &layout);

// Furniture for a room; `use` by name.
enum class Use { living, kitchen, bedroom, bath, study, office, store };
void furnish(Layout &layout, const Rect &room, Use use);
// Adds an open door leaf at the door `at` of a wall along x (or along y), hinged at its lower end,
// into the room above or below the wall.
void hang_door(Layout &layout, sim_point at, double width, bool along_x, bool upward);
// The same with an angle of the open leaf, such as door_angle() draws.
void hang_leaf(Layout &layout, sim_point at, double width, bool along_x, bool upward, double angle);
double door_angle(Layout &layout);

// Rotates the layout into the world frame about its centre, which becomes the origin.
void turn(Layout &layout, double angle);

// Settles loose bodies by physics simulation; removes those that end in walls, in doors or outside.
void settle(Layout &layout, double angle);

} // namespace sim

#endif
