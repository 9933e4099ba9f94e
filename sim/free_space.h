// free_space: free configuration space of the robot: a clearance grid in the frame of the scene,
// its largest connected component, and shortest paths in it.
#ifndef CAIRN_SIM_FREE_SPACE_H
#define CAIRN_SIM_FREE_SPACE_H

#include "sim/layout.h"

namespace sim
{

class FreeSpace
{
  public:
    // `layout` is already turned by `angle`.
    FreeSpace(const Layout &layout, double angle);

    const std::vector<int32_t> &cells() const // of the largest connected component, ascending
    {
        return connected;
    }
    sim_point middle(int32_t cell) const;
    int32_t cell_of(sim_point p) const; // -1 outside
    bool reachable(sim_point p) const;
    int32_t nearest_reachable(sim_point p) const; // a cell
    const std::vector<sim_point> &
    cut_off() const // a point in every other component of at least 0.5 m2
    {
        return others;
    }

    // Returns the length of the shortest path from a reachable cell to every cell; 1e9:
    // unreachable.
    std::vector<double> distances(int32_t from) const;
    // Returns the path between two reachable cells, both included, with straight collision-free
    // legs.
    std::vector<sim_point> way(int32_t from, int32_t to) const;

  private:
    void approach(const Body &body, std::vector<double> &nearest) const;
    bool straight(sim_point a, sim_point b) const;
    void search(int32_t from, int32_t to, std::vector<double> &cost,
                std::vector<int32_t> &parent) const;

    double width, height;
    sim_point axis; // of the scene's x in the world
    int32_t columns, rows;
    std::vector<float> clearance;
    std::vector<char> inside; // 1: in the largest connected component
    std::vector<int32_t> connected;
    std::vector<sim_point> others;
};

} // namespace sim

#endif
