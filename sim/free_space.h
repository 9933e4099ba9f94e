// free_space: where a robot can be: a grid of clearances in the frame of the scene, its largest
// connected part, and shortest ways through it.
#ifndef CAIRN_SIM_FREE_SPACE_H
#define CAIRN_SIM_FREE_SPACE_H

#include "sim/layout.h"

namespace sim
{

constexpr double free_clearance = 0.3; // m

class FreeSpace
{
  public:
    // `layout` is already turned by `angle`.
    FreeSpace(const Layout &layout, double angle);

    const std::vector<int32_t> &cells() const // of the largest connected part, ascending
    {
        return connected;
    }
    sim_point middle(int32_t cell) const;
    int32_t cell_of(sim_point p) const; // -1 outside
    bool reachable(sim_point p) const;
    int32_t nearest_reachable(sim_point p) const; // a cell
    const std::vector<sim_point> &cut_off() const // a point in every other part of at least 0.5 m2
    {
        return others;
    }

    // Length of the shortest way from a reachable cell to every cell; 1e9 where there is none.
    std::vector<double> distances(int32_t from) const;
    // The way from one reachable cell to another, both included, with straight legs that keep
    // clear.
    std::vector<sim_point> way(int32_t from, int32_t to) const;

  private:
    bool straight(sim_point a, sim_point b) const;
    void search(int32_t from, int32_t to, std::vector<double> &cost,
                std::vector<int32_t> &parent) const;

    double width, height;
    sim_point axis; // of the scene's x in the world
    int32_t columns, rows;
    std::vector<float> clearance;
    std::vector<char> inside; // 1: of the largest connected part
    std::vector<int32_t> connected;
    std::vector<sim_point> others;
};

} // namespace sim

#endif
