#include "sim/free_space.h"

#include <algorithm>
#include <queue>

namespace sim
{

constexpr double cell_side = 0.1;
constexpr double most_clearance = 2; // m, of a cell

// Lowers the clearance of the cells near a body.
void FreeSpace::approach(const Body &body, std::vector<double> &nearest) const
{
    Outline outline(body);
    double reach = body.reach();
    std::vector<sim_point> corners = body.outline();
    sim_point low = {1e9, 1e9}, high = {-1e9, -1e9};

    if (body.radius > 0)
        corners.push_back(body.centre);
    for (sim_point corner : corners) {
        sim_point p = turned(corner, {axis.x, -axis.y});

        low = {std::min(low.x, p.x), std::min(low.y, p.y)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    auto index = [](double at, double side, int32_t count) {
        return (int32_t)std::clamp(std::floor((at + side / 2) / cell_side), 0.0, count - 1.0);
    };
    double margin = most_clearance + body.radius + cell_side;
    int32_t left = index(low.x - margin, width, columns),
            right = index(high.x + margin, width, columns);
    int32_t bottom = index(low.y - margin, height, rows),
            top = index(high.y + margin, height, rows);

    for (int32_t row = bottom; row <= top; row++)
        for (int32_t column = left; column <= right; column++) {
            int32_t cell = row * columns + column;
            sim_point p = middle(cell), apart = body.centre - p;
            double far = nearest[(size_t)cell] + reach;

            if (dot(apart, apart) < far * far)
                nearest[(size_t)cell] = std::min(nearest[(size_t)cell], outline.distance(p));
        }
}

FreeSpace::FreeSpace(const Layout &layout, double angle)
    : width(layout.width), height(layout.height), axis(direction(angle))
{
    std::vector<double> nearest;
    std::vector<int32_t> stack, part;

    columns = (int32_t)std::ceil(width / cell_side);
    rows = (int32_t)std::ceil(height / cell_side);
    nearest.assign((size_t)(columns * rows), most_clearance);
    inside.assign(nearest.size(), 0);
    for (const Body &body : layout.bodies)
        approach(body, nearest);
    clearance.assign(nearest.begin(), nearest.end());

    std::vector<char> seen(clearance.size(), 0);
    for (int32_t start = 0; start < columns * rows; start++) {
        if (seen[(size_t)start] || (double)clearance[(size_t)start] < layout.clearance)
            continue;
        part.clear();
        stack.assign(1, start);
        seen[(size_t)start] = 1;
        while (!stack.empty()) {
            int32_t cell = stack.back(), column = cell % columns, row = cell / columns;

            stack.pop_back();
            part.push_back(cell);
            for (int side = 0; side < 4; side++) {
                int32_t c = column + (side == 0) - (side == 1), r = row + (side == 2) - (side == 3);
                size_t next = (size_t)(r * columns + c);

                if (c < 0 || r < 0 || c >= columns || r >= rows || seen[next] ||
                    (double)clearance[next] < layout.clearance)
                    continue;
                seen[next] = 1;
                stack.push_back((int32_t)next);
            }
        }
        if (part.size() > connected.size())
            std::swap(part, connected);
        if ((double)part.size() * cell_side * cell_side > 0.5)
            others.push_back(middle(part[0]));
    }
    std::sort(connected.begin(), connected.end());
    for (int32_t cell : connected)
        inside[(size_t)cell] = 1;
}

sim_point FreeSpace::middle(int32_t cell) const
{
    int32_t column = cell % columns, row = cell / columns;
    double x = (column + 0.5) * cell_side - width / 2, y = (row + 0.5) * cell_side - height / 2;

    return turned({x, y}, axis);
}

int32_t FreeSpace::cell_of(sim_point p) const
{
    sim_point q = turned(p, {axis.x, -axis.y});
    double column = std::floor((q.x + width / 2) / cell_side),
           row = std::floor((q.y + height / 2) / cell_side);

    if (!(column >= 0 && row >= 0 && column < columns && row < rows))
        return -1;
    return (int32_t)row * columns + (int32_t)column;
}

bool FreeSpace::reachable(sim_point p) const
{
    int32_t cell = cell_of(p);

    return cell >= 0 && inside[(size_t)cell];
}

int32_t FreeSpace::nearest_reachable(sim_point p) const
{
    int32_t best = connected.front();

    if (reachable(p))
        return cell_of(p);
    for (int32_t cell : connected)
        if (length(middle(cell) - p) < length(middle(best) - p))
            best = cell;
    return best;
}

// Dijkstra's algorithm on the 8-connected grid; `to` < 0: all cells. Cells near walls have a higher
// cost.
void FreeSpace::search(int32_t from, int32_t to, std::vector<double> &cost,
                       std::vector<int32_t> &parent) const
{
    using Entry = std::pair<double, int32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;

    cost.assign(clearance.size(), 1e9);
    parent.assign(clearance.size(), -1);
    cost[(size_t)from] = 0;
    queue.push({0, from});
    while (!queue.empty()) {
        auto [so_far, cell] = queue.top();

        queue.pop();
        if (cell == to)
            return;
        if (so_far > cost[(size_t)cell])
            continue;
        for (int step = 0; step < 9; step++) {
            int32_t dc = step % 3 - 1, dr = step / 3 - 1, c = cell % columns + dc,
                    r = cell / columns + dr;
            size_t next = (size_t)(r * columns + c);
            double price;

            if (c < 0 || r < 0 || c >= columns || r >= rows || !inside[next])
                continue;
            price = so_far + cell_side * (dc && dr ? std::sqrt(2.0) : 1);
            if (to >= 0)
                price += cell_side * 0.3 * std::max(0.0, 0.7 - (double)clearance[next]) / 0.4;
            if (price >= cost[next])
                continue;
            cost[next] = price;
            parent[next] = cell;
            queue.push({price, (int32_t)next});
        }
    }
}

std::vector<double> FreeSpace::distances(int32_t from) const
{
    std::vector<double> cost;
    std::vector<int32_t> parent;

    search(from, -1, cost, parent);
    return cost;
}

bool FreeSpace::straight(sim_point a, sim_point b) const
{
    int steps = (int)std::ceil(length(b - a) / (cell_side / 2));

    for (int i = 0; i <= steps; i++)
        if (!reachable(a + (b - a) * (steps ? (double)i / steps : 0)))
            return false;
    return true;
}

std::vector<sim_point> FreeSpace::way(int32_t from, int32_t to) const
{
    std::vector<double> cost;
    std::vector<int32_t> parent, cells;
    std::vector<sim_point> way;

    search(from, to, cost, parent);
    for (int32_t cell = to; cell >= 0; cell = parent[(size_t)cell])
        cells.push_back(cell);
    std::reverse(cells.begin(), cells.end());
    way.push_back(middle(cells[0]));
    for (size_t i = 0; i + 1 < cells.size();) {
        size_t next = i + 1;

        // Straight legs of at most 2 m, so that the path keeps its clearance.
        while (next + 1 < cells.size() && next + 1 - i <= 20 &&
               straight(middle(cells[i]), middle(cells[next + 1])))
            next++;
        way.push_back(middle(cells[next]));
        i = next;
    }
    return way;
}

} // namespace sim
