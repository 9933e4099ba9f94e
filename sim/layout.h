// layout: the bodies of a scene while it is laid out, in the frame of the scene: (0, 0) lower left,
// (width, height) upper right; later turned into the world.
#ifndef CAIRN_SIM_LAYOUT_H
#define CAIRN_SIM_LAYOUT_H

#include <vector>

#include "sim/numbers.h"

namespace sim
{

constexpr double wall_thickness = 0.1;
// How far a wall reaches past its ends: short of the far face of a wall it meets there, so that no
// two faces coincide.
constexpr double wall_overlap = 0.048;

// A convex polygon (at most 8 vertices, counter-clockwise about its centre) or a disc.
struct Body {
    sim_kind kind;
    sim_point centre;
    double angle;
    double radius; // 0: a polygon
    std::vector<sim_point> vertices;
    bool curved;

    double reach() const; // radius of the circle about the centre that holds all of it
    std::vector<sim_point> outline() const; // vertices where the body lies; empty for a disc
    bool loose() const
    {
        return kind == SIM_BOX || kind == SIM_RUBBLE;
    }
};

Body make_box(sim_kind kind, sim_point centre, double along, double across, double angle);
Body make_disc(sim_kind kind, sim_point centre, double radius);

// A body where it lies, for many questions of distance.
class Outline
{
  public:
    explicit Outline(const Body &body);
    double distance(sim_point point) const; // from the point to the body, negative inside

  private:
    double radius;
    std::vector<sim_point> vertices; // the centre of a disc
};

double distance(const Body &body, sim_point point); // the same, asked once

// Gap between two bodies in m: exact when they overlap (then minus the depth by the separating
// axes), a lower bound of the distance when they do not.
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

// An opening in a wall: its middle is `at` metres along it.
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
    std::vector<Body> bodies;
    std::vector<sim_point> doors;
    std::vector<sim_point>
        places;    // given by the scene, in the order of the tour; others are chosen
    Random random; // of what stands
    Random loose;  // of what lies

    void wall(sim_point a, sim_point b, std::vector<Opening> openings = {});
    void walls(const Rect &rect);
    // Walls through the points, the sides of a curve.
    void curve(const std::vector<sim_point> &points);
    // Adds furniture unless it comes nearer than `room` to a body or to the way through a door.
    bool put(const Body &body, double room);
    // `count` pieces about the middle, spread by `spread`; they may overlap until they settle.
    void heap(const Rect &within, sim_point middle, double spread, int count, bool round);
    void box_about(const Rect &within);
    // Pieces of a wall that fell.
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

// Furniture for a room; `use` by name.
enum class Use { living, kitchen, bedroom, bath, study, office, store };
void furnish(Layout &layout, const Rect &room, Use use);
// An opened leaf at the door `at` of a wall along x (or along y), hung on its lower end, into the
// room above or below it.
void hang_door(Layout &layout, sim_point at, double width, bool along_x, bool upward);

// Turns the layout into the world frame: about its middle, which becomes the origin.
void turn(Layout &layout, double angle);

// Pushes loose bodies apart and lets them come to rest; takes away those that end up in walls, in
// doors or outside.
void settle(Layout &layout, double angle);

} // namespace sim

#endif
