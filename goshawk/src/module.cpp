// Python bindings of the renderer: contiguous arrays in, new arrays out; `goshawk/rendered/world.py` owns names and
// checks.
#include "bindings.hpp"
#include "parallel.hpp"
#include "render.hpp"

using namespace goshawk;

static std::vector<Vec3> as_points(const Table<3>& table) {
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < table.shape(0); ++i) points.push_back({table(i, 0), table(i, 1), table(i, 2)});
    return points;
}

// Row: kind, centre x y z, half x y z, material.
static std::vector<Solid> as_solids(const Table<8>& table) {
    std::vector<Solid> solids;
    for (std::size_t i = 0; i < table.shape(0); ++i)
        solids.push_back({static_cast<Kind>(static_cast<int>(table(i, 0))),
                          {table(i, 1), table(i, 2), table(i, 3)},
                          {table(i, 4), table(i, 5), table(i, 6)},
                          static_cast<int>(table(i, 7))});
    return solids;
}

// Row: albedo, patch size, patch contrast, noise size, noise contrast, seed, period.
static std::vector<Material> as_materials(const Table<7>& table) {
    std::vector<Material> materials;
    for (std::size_t i = 0; i < table.shape(0); ++i)
        materials.push_back({static_cast<float>(table(i, 0)), static_cast<float>(table(i, 1)),
                             static_cast<float>(table(i, 2)), static_cast<float>(table(i, 3)),
                             static_cast<float>(table(i, 4)), static_cast<std::uint32_t>(table(i, 5)), table(i, 6)});
    return materials;
}

static nb::tuple cast_rays(Table<8> solid_table, Table<3> origins, Table<3> directions, int threads) {
    const auto solids = as_solids(solid_table);
    const std::size_t count = directions.shape(0);
    auto ranges = new_array<double>({count});
    auto index = new_array<std::int32_t>({count});
    const bool common_origin = origins.shape(0) == 1;
    {
        nb::gil_scoped_release release;
        constexpr std::size_t chunk = 4096;
        parallel_rows(static_cast<int>((count + chunk - 1) / chunk), threads, [&](int row) {
            for (std::size_t i = row * chunk; i < std::min(count, (row + 1) * chunk); ++i) {
                const std::size_t o = common_origin ? 0 : i;
                const Hit hit = cast(solids, {origins(o, 0), origins(o, 1), origins(o, 2)},
                                     {directions(i, 0), directions(i, 1), directions(i, 2)});
                ranges.data()[i] = hit.range;
                index.data()[i] = hit.solid;
            }
        });
    }
    return nb::make_tuple(ranges, index);
}

static nb::ndarray<nb::numpy, std::uint8_t> render_view(Table<8> solids, Table<7> materials, Table<3> lamps, Rays rays,
                                                        Matrix4 T_world_camera, double gain, double noise,
                                                        double vignette, std::uint64_t seed, int threads) {
    auto image = new_array<std::uint8_t>({rays.shape(0), rays.shape(1)});
    const auto solid_list = as_solids(solids);
    const auto material_list = as_materials(materials);
    const auto lamp_list = as_points(lamps);
    nb::gil_scoped_release release;
    render(solid_list, material_list, lamp_list, rays.data(), static_cast<int>(rays.shape(0)),
           static_cast<int>(rays.shape(1)), Pose(T_world_camera.data()), {gain, noise, vignette, seed}, threads,
           image.data());
    return image;
}

NB_MODULE(_rendering, m) {
    m.def("cast_rays", &cast_rays, nb::arg("solids"), nb::arg("origins"), nb::arg("directions"), nb::arg("threads"));
    m.def("render", &render_view, nb::arg("solids"), nb::arg("materials"), nb::arg("lamps"), nb::arg("rays"),
          nb::arg("T_world_camera"), nb::arg("gain"), nb::arg("noise"), nb::arg("vignette"), nb::arg("seed"),
          nb::arg("threads"));
}
