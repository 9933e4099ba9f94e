// places: greedy view planning: positions whose scans together cover the arena with sufficient
// overlap.
#include "sim/arena_parts.h"

#include <algorithm>

namespace sim
{

constexpr int view_rays = 72;
constexpr double view_range = 8,
                 patch = 0.25; // m; a patch is a square of the plane with some surface in it
constexpr double least_apart = 0.3;

// Returns the surface patches visible from a point (ray casting).
static std::vector<int64_t> view_from(const World &world, sim_point from)
{
    std::vector<int64_t> view;

    for (int ray = 0; ray < view_rays; ray++) {
        double angle = 2 * pi * ray / view_rays;
        Hit hit = world.cast(from, angle, view_range);
        sim_point p = from + direction(angle) * hit.range;

        if (hit.any)
            view.push_back((int64_t)std::floor(p.x / patch) * 100000 +
                           (int64_t)std::floor(p.y / patch));
    }
    std::sort(view.begin(), view.end());
    view.erase(std::unique(view.begin(), view.end()), view.end());
    return view;
}

// Orders the places as a short tour: nearest neighbour heuristic from the first place, then 2-opt;
// the scene's own places keep their order.
static void shorten_tour(const FreeSpace &space, std::vector<sim_point> &places)
{
    size_t n = places.size();
    std::vector<std::vector<double>> apart;
    std::vector<size_t> tour = {0};
    std::vector<sim_point> ordered;

    for (sim_point from : places) {
        std::vector<double> all = space.distances(space.nearest_reachable(from)), row;

        for (sim_point to : places)
            row.push_back(all[(size_t)space.nearest_reachable(to)]);
        apart.push_back(row);
    }
    while (tour.size() < n) {
        size_t best = n;

        for (size_t i = 0; i < n; i++)
            if (std::find(tour.begin(), tour.end(), i) == tour.end() &&
                (best == n || apart[tour.back()][i] < apart[tour.back()][best]))
                best = i;
        tour.push_back(best);
    }
    for (bool better = true; better;) {
        better = false;
        for (size_t i = 1; i + 1 < n; i++)
            for (size_t k = i + 1; k < n; k++) {
                double before =
                    apart[tour[i - 1]][tour[i]] + (k + 1 < n ? apart[tour[k]][tour[k + 1]] : 0);
                double after =
                    apart[tour[i - 1]][tour[k]] + (k + 1 < n ? apart[tour[i]][tour[k + 1]] : 0);

                if (after < before - 1e-9) {
                    std::reverse(tour.begin() + (ptrdiff_t)i, tour.begin() + (ptrdiff_t)k + 1);
                    better = true;
                }
            }
    }
    ordered.reserve(tour.size());
    for (size_t i : tour)
        ordered.push_back(places[i]);
    places = ordered;
}

std::vector<sim_point> choose_places(const sim_arena &arena, int count, uint64_t seed)
{
    Random random(seed, place_stream);
    World world(arena.layout.bodies);
    const std::vector<int32_t> &cells = arena.space.cells();
    std::vector<sim_point> places, candidates;
    std::vector<std::vector<int64_t>> views;
    std::vector<double> nearest; // distance of each candidate to the places
    std::vector<int64_t> seen;

    for (sim_point place : arena.layout.places)
        if ((int)places.size() < count)
            places.push_back(place);
    if ((int)places.size() == count || cells.empty())
        return places;
    for (int i = 0; i < std::max(500, 5 * count); i++) {
        sim_point p = arena.space.middle(cells[(size_t)random.below((int)cells.size())]);

        candidates.push_back(p);
        views.push_back(view_from(world, p));
        nearest.push_back(3);
    }
    auto take = [&](sim_point place) {
        std::vector<int64_t> view = view_from(world, place), all;

        std::set_union(seen.begin(), seen.end(), view.begin(), view.end(), std::back_inserter(all));
        seen = all;
        for (size_t i = 0; i < candidates.size(); i++)
            nearest[i] = std::min(nearest[i], length(candidates[i] - place));
    };
    for (sim_point place : places)
        take(place);
    while ((int)places.size() < count) {
        double best_score = -1;
        size_t best = 0;

        for (size_t i = 0; i < candidates.size(); i++) {
            std::vector<int64_t> known;
            double overlap, score;

            if (nearest[i] < least_apart)
                continue;
            std::set_intersection(seen.begin(), seen.end(), views[i].begin(), views[i].end(),
                                  std::back_inserter(known));
            overlap = (double)known.size() / (double)std::max<size_t>(1, views[i].size());
            score = (double)(views[i].size() - known.size()) + 6 * nearest[i];
            // Views with less than a quarter overlap with the covered surface are ranked last.
            if (!places.empty() && overlap < 0.25)
                score *= overlap / 10;
            if (score > best_score) {
                best_score = score;
                best = i;
            }
        }
        if (best_score < 0)
            break;
        places.push_back(candidates[best]);
        take(candidates[best]);
    }
    if (arena.layout.places.empty())
        shorten_tour(arena.space, places);
    return places;
}

} // namespace sim
