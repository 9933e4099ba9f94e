#include "sim/world.h"

namespace sim
{

constexpr uintptr_t robot_tag = UINTPTR_MAX;
constexpr uintptr_t mover_tag = UINTPTR_MAX - 1;

static b2Vec2 vector(sim_point p)
{
    return b2Vec2((float)p.x, (float)p.y);
}

b2Body *add_body(b2World &world, const Body &body, b2BodyType type, uintptr_t tag)
{
    b2BodyDef def;
    b2FixtureDef fixture;
    b2PolygonShape polygon;
    b2CircleShape disc;
    b2Vec2 vertices[b2_maxPolygonVertices];
    b2Body *made;

    def.type = type;
    def.position = vector(body.centre);
    def.angle = (float)body.angle;
    made = world.CreateBody(&def);
    if (body.radius > 0) {
        disc.m_radius = (float)body.radius;
        fixture.shape = &disc;
    } else {
        for (size_t i = 0; i < body.vertices.size(); i++)
            vertices[i] = vector(body.vertices[i]);
        polygon.Set(vertices, (int32)body.vertices.size());
        fixture.shape = &polygon;
    }
    fixture.density = 1;
    fixture.friction = 0.4f;
    fixture.userData.pointer = tag;
    made->CreateFixture(&fixture);
    return made;
}

World::World(const std::vector<Body> &bodies, double radius_of_robot)
    : world(b2Vec2(0, 0)), own_radius(radius_of_robot)
{
    for (size_t i = 0; i < bodies.size(); i++) {
        add_body(world, bodies[i], b2_staticBody, i);
        least_cosine.push_back(bodies[i].kind == SIM_GLASS ? std::cos(bodies[i].glass) : 0);
    }
    world.SetContactListener(this);
}

namespace
{
class Nearest : public b2RayCastCallback
{
  public:
    Nearest(sim_point ray, const std::vector<double> &least) : along(ray), least_cosine(least)
    {
    }
    float ReportFixture(b2Fixture *fixture, const b2Vec2 &, const b2Vec2 &surface_normal,
                        float part) override
    {
        uintptr_t met = fixture->GetUserData().pointer;

        if (met == robot_tag)
            return -1;
        if (met < least_cosine.size() && least_cosine[met] > 0 &&
            -dot(along, {(double)surface_normal.x, (double)surface_normal.y}) < least_cosine[met])
            return -1;
        // Ties at a shared corner are resolved by the smaller index, independent of the order of
        // the tree.
        if (any && part == fraction && met > tag)
            return fraction;
        any = true;
        tag = met;
        fraction = part;
        normal = surface_normal;
        return part;
    }
    bool any = false;
    uintptr_t tag = 0;
    float fraction = 1;
    b2Vec2 normal = b2Vec2(0, 0);

  private:
    sim_point along;
    const std::vector<double> &least_cosine;
};
} // namespace

Hit World::cast(sim_point from, double angle, double range) const
{
    Nearest nearest(direction(angle), least_cosine);
    b2Vec2 start = vector(from), end = vector(from + direction(angle) * range);

    world.RayCast(&nearest, start, end);
    if (!nearest.any)
        return {false, 0, range, {0, 0}};
    return {true,
            nearest.tag == mover_tag ? hit_mover : (int32_t)nearest.tag,
            (double)nearest.fraction * range,
            {(double)nearest.normal.x, (double)nearest.normal.y}};
}

void World::step()
{
    world.Step((float)time_step, 8, 3);
}

void World::place_robot(sim_pose pose)
{
    if (!robot_body) {
        robot_body = add_body(world, make_disc(SIM_FURNITURE, {pose.x, pose.y}, own_radius),
                              b2_dynamicBody, robot_tag);
        robot_body->SetSleepingAllowed(false);
    }
    robot_body->SetTransform(b2Vec2((float)pose.x, (float)pose.y), (float)pose.theta);
    robot_body->SetLinearVelocity(b2Vec2(0, 0));
    robot_body->SetAngularVelocity(0);
}

void World::drive_robot(double speed, double turn_rate)
{
    robot_body->SetLinearVelocity(vector(direction((double)robot_body->GetAngle()) * speed));
    robot_body->SetAngularVelocity((float)turn_rate);
}

sim_pose World::robot() const
{
    b2Vec2 at = robot_body->GetPosition();

    return {(double)at.x, (double)at.y, wrap((double)robot_body->GetAngle())};
}

size_t World::add_mover(sim_point at, double radius)
{
    movers.push_back(
        add_body(world, make_disc(SIM_FURNITURE, at, radius), b2_dynamicBody, mover_tag));
    movers.back()->SetSleepingAllowed(false);
    return movers.size() - 1;
}

sim_point World::mover(size_t index) const
{
    b2Vec2 at = movers[index]->GetPosition();

    return {(double)at.x, (double)at.y};
}

void World::move_mover(size_t index, sim_point velocity)
{
    movers[index]->SetLinearVelocity(vector(velocity));
}

void World::place_mover(size_t index, sim_point at)
{
    movers[index]->SetTransform(vector(at), 0);
}

void World::BeginContact(b2Contact *contact)
{
    if (contact->GetFixtureA()->GetUserData().pointer == robot_tag ||
        contact->GetFixtureB()->GetUserData().pointer == robot_tag)
        bump_count++;
}

} // namespace sim
