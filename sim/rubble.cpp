// rubble: loose bodies are scattered where they may overlap, kicked and pushed apart by Box2D until
// they rest. Discs settle 5 mm larger than they are: Box2D lets bodies at rest overlap by that
// much, and keeps polygons apart by skins of their own. Bodies that still overlap, block a door or
// left the arena are removed.
#include "sim/world.h"

#include <algorithm>

namespace sim
{

constexpr double slop = 0.005;
constexpr int kicks = 3, steps_between_kicks = 40, most_steps = 1500;

static bool at_rest(const std::vector<b2Body *> &pieces)
{
    for (const b2Body *piece : pieces)
        if (piece->IsAwake())
            return false;
    return true;
}

// Returns true when the body is inside the walls, overlaps no body and blocks no door.
static bool lies_well(const Layout &layout, const Body &body, const std::vector<Body> &others,
                      double angle)
{
    sim_point p = turned(body.centre, -angle);

    if (std::abs(p.x) > layout.width / 2 || std::abs(p.y) > layout.height / 2)
        return false;
    for (sim_point door : layout.doors)
        if (distance(body, door) < 0.45)
            return false;
    for (const Body &other : others)
        if (length(other.centre - body.centre) < other.reach() + body.reach() &&
            gap(other, body) < -slop * 0.8)
            return false;
    return true;
}

void settle(Layout &layout, double angle)
{
    b2World world(b2Vec2(0, 0));
    std::vector<b2Body *> pieces;
    std::vector<Body> kept, loose;

    for (const Body &body : layout.bodies) {
        if (!body.loose()) {
            add_body(world, body, b2_staticBody, 0);
            kept.push_back(body);
            continue;
        }
        Body grown = body;
        if (grown.radius > 0)
            grown.radius += slop;
        pieces.push_back(add_body(world, grown, b2_dynamicBody, 0));
        pieces.back()->SetLinearDamping(3);
        pieces.back()->SetAngularDamping(3);
        loose.push_back(body);
    }
    for (int step = 0;
         step < most_steps && !(step > kicks * steps_between_kicks && at_rest(pieces)); step++) {
        if (step < kicks * steps_between_kicks && step % steps_between_kicks == 0)
            for (b2Body *piece : pieces) {
                double x = layout.loose.normal(), y = layout.loose.normal(),
                       spin = layout.loose.normal();

                piece->SetLinearVelocity(b2Vec2((float)(0.4 * x), (float)(0.4 * y)));
                piece->SetAngularVelocity((float)(2 * spin));
            }
        world.Step(1 / 60.0f, 8, 8);
    }
    for (size_t i = 0; i < pieces.size(); i++) {
        b2Vec2 at = pieces[i]->GetPosition();

        loose[i].centre = {(double)at.x, (double)at.y};
        loose[i].angle = wrap((double)pieces[i]->GetAngle());
        if (lies_well(layout, loose[i], kept, angle))
            kept.push_back(loose[i]);
    }
    layout.bodies = kept;
}

} // namespace sim
