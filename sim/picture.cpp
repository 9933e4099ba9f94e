// picture: draws an arena and its survey as SVG.
#include "sim/files.h"

#include <algorithm>
#include <vector>

#include "sim/numbers.h"
#include "sim/text.h"

using namespace sim;

namespace
{
constexpr double scale = 60; // pixels per m

class Picture
{
  public:
    explicit Picture(const sim_survey *s) : survey(s), arena(sim_survey_arena(s))
    {
        const sim_edge *edges = sim_arena_edges(arena, &edge_count);

        low = {1e9, 1e9};
        high = {-1e9, -1e9};
        for (int32_t i = 0; i < edge_count; i++) {
            double r = edges[i].radius;

            low = {std::min(low.x, edges[i].a.x - r), std::min(low.y, edges[i].a.y - r)};
            high = {std::max(high.x, edges[i].a.x + r), std::max(high.y, edges[i].a.y + r)};
        }
        low = low - sim_point{0.4, 0.9};
        high = high + sim_point{0.4, 0.4};
    }

    int32_t write(FILE *file)
    {
        double w = (high.x - low.x) * scale, h = (high.y - low.y) * scale;

        text << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"";
        text.fixed(w, 0) << "\" height=\"";
        text.fixed(h, 0) << "\" viewBox=\"0 0 ";
        text.fixed(w, 0) << " ";
        text.fixed(h, 0)
            << "\">\n"
            << "<style>.glass{fill:#4aa3c7}.floor{fill:#f7f5f0}.seen{fill:#9cc7e6}"
               ".wall{fill:#33373d}.furniture{fill:#d8cbb2;stroke:#8d7d60}.box{fill:#d9a05b;stroke:"
               "#96662f}"
               ".rubble{fill:#b3aca2;stroke:#7d776e}.way{fill:none;stroke:#2b6cb0;stroke-width:1.6;"
               "stroke-opacity:.75;stroke-dasharray:5 4;stroke-linejoin:round}"
               ".look{stroke:#d1495b;stroke-width:2;stroke-linecap:round}.scan{fill:#d1495b;stroke:"
               "#fff}"
               "text{font:15px "
               "sans-serif;fill:#33373d}.bar{stroke:#33373d;stroke-width:3}</style>\n"
            << "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n";
        floor();
        seen();
        bodies();
        way();
        scans();
        caption(h);
        text << "</svg>\n";
        return text.write(file);
    }

  private:
    void point(sim_point p)
    {
        text.fixed((p.x - low.x) * scale, 1) << ",";
        text.fixed((high.y - p.y) * scale, 1) << " ";
    }

    void disc(sim_point p, double pixels, const char *sort)
    {
        text << "<circle class=\"" << sort << "\" cx=\"";
        text.fixed((p.x - low.x) * scale, 1) << "\" cy=\"";
        text.fixed((high.y - p.y) * scale, 1) << "\" r=\"";
        text.fixed(pixels, 1) << "\"/>\n";
    }

    // The convex hull of all walls (Andrew 1979).
    void floor()
    {
        const sim_edge *edges = sim_arena_edges(arena, &edge_count);
        std::vector<sim_point> points, hull;

        for (int32_t i = 0; i < edge_count; i++)
            points.push_back(edges[i].a);
        std::sort(points.begin(), points.end(),
                  [](sim_point a, sim_point b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
        for (int side = 0; side < 2; side++) {
            size_t start = hull.size();

            for (sim_point p : points) {
                while (hull.size() >= start + 2 &&
                       cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0)
                    hull.pop_back();
                hull.push_back(p);
            }
            hull.pop_back();
            std::reverse(points.begin(), points.end());
        }
        text << "<polygon class=\"floor\" points=\"";
        for (sim_point p : hull)
            point(p);
        text << "\"/>\n";
    }

    // The free space of every scan, one beam in eight.
    void seen()
    {
        int32_t count;
        const sim_scan *scans = sim_survey_scans(survey, &count);

        for (int32_t i = 0; i < count; i++) {
            const sim_scan &scan = scans[i];
            sim_pose sensor = compose(scan.truth, scan.base_sensor);
            int32_t every = std::max(1, scan.count / 100);

            text << "<polygon class=\"seen\" fill-opacity=\"";
            text.fixed(std::clamp(6.0 / count, 0.02, 0.12), 3) << "\" points=\"";
            point({sensor.x, sensor.y});
            for (int32_t k = 0; k < scan.count; k += every) {
                double range = std::min((double)scan.range[k], scan.range_max),
                       share = (double)k / (scan.count - 1);
                double angle = scan.angle_min + k * scan.angle_step;
                sim_pose base = blend(scan.truth, compose(scan.truth, scan.motion), share);
                sim_pose beam = compose(compose(base, scan.base_sensor), {0, 0, angle});

                if (!std::isnan(scan.range[k]))
                    point(sim_point{beam.x, beam.y} + direction(beam.theta) * range);
            }
            text << "\"/>\n";
        }
    }

    void bodies()
    {
        static const char *const sorts[] = {"wall", "furniture", "box", "rubble", "glass"};
        int32_t count;
        const sim_body *all = sim_arena_bodies(arena, &count);
        const sim_edge *edges = sim_arena_edges(arena, &edge_count);

        for (int32_t i = 0; i < count; i++) {
            const sim_body &body = all[i];

            if (body.radius > 0) {
                disc(body.centre, body.radius * scale, sorts[body.kind]);
                continue;
            }
            text << "<polygon class=\"" << sorts[body.kind] << "\" points=\"";
            for (int32_t k = 0; k < body.edge_count; k++)
                point(edges[body.first_edge + k].a);
            text << "\"/>\n";
        }
    }

    void way()
    {
        int32_t count;
        const sim_pose *path = sim_survey_path(survey, &count);
        sim_point last = {1e9, 1e9};

        text << "<polyline class=\"way\" points=\"";
        for (int32_t i = 0; i < count; i++) {
            sim_point p = {path[i].x, path[i].y};

            if (length(p - last) < 0.02)
                continue;
            point(p);
            last = p;
        }
        text << "\"/>\n";
    }

    void scans()
    {
        int32_t count;
        const sim_scan *all = sim_survey_scans(survey, &count);

        for (int32_t i = 0; i < count; i++) {
            sim_pose sensor = compose(all[i].truth, all[i].base_sensor);
            sim_point p = {sensor.x, sensor.y};

            text << "<polyline class=\"look\" points=\"";
            point(p);
            point(p + direction(sensor.theta) * 0.22);
            text << "\"/>\n";
        }
        for (int32_t i = 0; i < count; i++)
            disc({all[i].truth.x, all[i].truth.y}, 3.5, "scan");
    }

    void caption(double h)
    {
        sim_arena_options o = sim_arena_options_of(arena);
        int32_t count;

        sim_survey_scans(survey, &count);
        text << "<path class=\"bar\" d=\"M24 ";
        text.fixed(h - 24, 0) << "h" << 2 * scale << "\"/>\n<text x=\"" << 34 + 2 * scale
                              << "\" y=\"";
        text.fixed(h - 19, 0) << "\">2 m &#160;&#160; " << sim_scene_name(o.scene) << ", "
                              << o.width << " &#215; " << o.height << " m, seed " << o.seed << ", "
                              << count << " scans</text>\n";
    }

    const sim_survey *survey;
    const sim_arena *arena;
    int32_t edge_count = 0;
    sim_point low, high;
    Text text;
};
} // namespace

int32_t sim_write_picture(const sim_survey *survey, FILE *file)
{
    return Picture(survey).write(file);
}
