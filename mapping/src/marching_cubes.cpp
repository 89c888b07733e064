#include "marching_cubes.hpp"

#include <algorithm>
#include <utility>

namespace goshawk {
namespace {

// Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Edge e = 4 * axis + (position of the other two axes).
struct Edge {
    int from, to, axis;
};

std::array<Edge, 12> make_edges() {
    std::array<Edge, 12> edges{};
    for (int axis = 0; axis < 3; ++axis)
        for (int place = 0; place < 4; ++place) {
            const int first = 1 << ((axis + 1) % 3), second = 1 << ((axis + 2) % 3);
            const int from = (place & 1) * first + (place >> 1) * second;
            edges[4 * axis + place] = {from, from + (1 << axis), axis};
        }
    return edges;
}

const std::array<Edge, 12> edges = make_edges();

int edge_between(int a, int b) {
    for (int e = 0; e < 12; ++e)
        if ((edges[e].from == a && edges[e].to == b) || (edges[e].from == b && edges[e].to == a)) return e;
    return -1;
}

using Loops = std::vector<std::vector<int>>;

// The polygons of one of the 256 sign patterns (bit c set: corner c is inside). On each face of the cell, walked
// counter-clockwise from outside, a cut enters at an edge that goes from outside to inside and leaves at the next edge
// that goes back. So inside corners are kept apart on ambiguous faces, by a rule that depends on the face alone: the
// neighbour cuts the shared face in the same way and the surface closes. Chained over the six faces, cuts form loops.
Loops loops_of(int inside) {
    std::array<int, 12> next;
    next.fill(-1);
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
            const int base = side << axis, a = 1 << ((axis + 1) % 3), b = 1 << ((axis + 2) % 3);
            std::array<int, 4> ring = {base, base + a, base + a + b, base + b};
            if (side == 0) std::swap(ring[1], ring[3]);
            for (int i = 0; i < 4; ++i) {
                if ((inside >> ring[i] & 1) || !(inside >> ring[(i + 1) % 4] & 1)) continue;
                int last = i + 1;  // ring[last] is inside; find where the walk leaves it again
                while (inside >> ring[(last + 1) % 4] & 1) ++last;
                const int enter = edge_between(ring[i], ring[(i + 1) % 4]);
                const int leave = edge_between(ring[last % 4], ring[(last + 1) % 4]);
                next[leave] = enter;
            }
        }
    Loops loops;
    for (int start = 0; start < 12; ++start) {
        std::vector<int> loop;
        for (int e = start; next[e] >= 0;) {
            loop.push_back(e);
            const int following = next[e];
            next[e] = -1;
            e = following;
        }
        if (!loop.empty()) loops.push_back(loop);
    }
    return loops;
}

const std::vector<Loops>& table() {
    static const std::vector<Loops> all = [] {
        std::vector<Loops> result;
        for (int inside = 0; inside < 256; ++inside) result.push_back(loops_of(inside));
        return result;
    }();
    return all;
}

class Builder {
  public:
    Builder(const Volume& volume, double least_weight)
        : volume_(volume), grid_(volume.grid), least_weight_(least_weight) {
        const std::size_t in_slab = static_cast<std::size_t>(grid_.shape[1]) * grid_.shape[2];
        for (auto& numbers : numbers_) numbers.assign(3 * in_slab, -1);
        bricks_.assign(grid_.brick_index(grid_.bricks(0), 0, 0), none);
        for (int n = 0; n < volume.count; ++n) {
            const std::int32_t* place = volume.place + 3 * n;
            bricks_[grid_.brick_index(place[0], place[1], place[2])] = n;
        }
    }

    Mesh build() {
        for (int i = 0; i + 1 < grid_.shape[0]; ++i) {
            for (int j = 0; j + 1 < grid_.shape[1]; ++j)
                for (int z = 0; z < grid_.bricks(2); ++z) {
                    if (bricks_[grid_.brick_index(i / brick_size, j / brick_size, z)] == none) continue;
                    const int end = std::min(brick_size * (z + 1), grid_.shape[2] - 1);
                    for (int k = brick_size * z; k < end; ++k) cell(i, j, k);
                }
            std::swap(numbers_[0], numbers_[1]);
            numbers_[1].assign(numbers_[1].size(), -1);
        }
        return std::move(mesh_);
    }

  private:
    static constexpr std::int32_t none = -1;

    // Whether a voxel is in a brick that is kept, and where its values are.
    bool find(int i, int j, int k, std::size_t& index) const {
        const std::int32_t n = bricks_[grid_.brick_index(i / brick_size, j / brick_size, k / brick_size)];
        if (n == none) return false;
        index = n * brick_voxels + within_brick(i, j, k);
        return true;
    }

    void cell(int i, int j, int k) {
        std::size_t corners[8];
        int inside = 0;
        for (int corner = 0; corner < 8; ++corner) {
            std::size_t& index = corners[corner];
            if (!find(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2 & 1), index)) return;
            if (!(volume_.weight[index] >= least_weight_)) return;
            inside |= (volume_.distance[index] < 0.0f) << corner;
        }
        for (const auto& loop : table()[inside]) {
            std::array<std::int32_t, 12> at{};
            for (std::size_t n = 0; n < loop.size(); ++n) at[n] = vertex(i, j, k, edges[loop[n]], corners);
            for (std::size_t n = 2; n < loop.size(); ++n) mesh_.faces.push_back({at[0], at[n], at[n - 1]});
        }
    }

    // The vertex on a grid edge, made once and shared by the cells around it.
    std::int32_t vertex(int i, int j, int k, const Edge& edge, const std::size_t (&corners)[8]) {
        const int slab = edge.from & 1;
        const std::size_t within = grid_.index(0, j + (edge.from >> 1 & 1), k + (edge.from >> 2 & 1));
        std::int32_t& number = numbers_[slab][3 * within + edge.axis];
        if (number < 0) {
            number = static_cast<std::int32_t>(mesh_.vertices.size());
            add_vertex(corners[edge.from], corners[edge.to],
                       {i + (edge.from & 1) + 0.5, j + (edge.from >> 1 & 1) + 0.5, k + (edge.from >> 2 & 1) + 0.5},
                       edge.axis);
        }
        return number;
    }

    void add_vertex(std::size_t from, std::size_t to, Vec3 place, int axis) {
        const double a = volume_.distance[from], b = volume_.distance[to], share = a / (a - b);
        const Vec3 along{axis == 0 ? share : 0.0, axis == 1 ? share : 0.0, axis == 2 ? share : 0.0};
        mesh_.vertices.push_back(grid_.origin + grid_.voxel * (place + along));
        const double wa = (1.0 - share) * (volume_.colour_weight[from] > 0.0f) + 1e-9;
        const double wb = share * (volume_.colour_weight[to] > 0.0f) + 1e-9;
        for (int c = 0; c < volume_.channels; ++c)
            mesh_.colours.push_back(static_cast<float>(
                (wa * volume_.colour[from * volume_.channels + c] + wb * volume_.colour[to * volume_.channels + c]) /
                (wa + wb)));
        mesh_.weights.push_back(static_cast<float>((1.0 - share) * volume_.weight[from] + share * volume_.weight[to]));
        mesh_.scatters.push_back(
            static_cast<float>((1.0 - share) * volume_.scatter[from] + share * volume_.scatter[to]));
        mesh_.images.push_back(volume_.images[share < 0.5 ? from : to]);
    }

    const Volume& volume_;
    const VoxelGrid& grid_;
    double least_weight_;
    std::vector<std::int32_t> bricks_;      // number of each brick of the grid among those near surfaces
    std::vector<std::int32_t> numbers_[2];  // vertex on the edge that leaves each corner of slab i, i + 1 along an axis
    Mesh mesh_;
};

}  // namespace

Mesh marching_cubes(const Volume& volume, double least_weight) { return Builder(volume, least_weight).build(); }

}  // namespace goshawk
