// Python bindings of the mapping kernels: contiguous arrays in, new arrays out; the wrappers own names and checks.
#include <nanobind/stl/array.h>

#include <algorithm>
#include <array>

#include "bindings.hpp"
#include "consistency.hpp"
#include "contradiction.hpp"
#include "lines.hpp"
#include "marching_cubes.hpp"
#include "near_surface.hpp"
#include "spherical_stereo.hpp"
#include "tsdf.hpp"

using namespace goshawk;

using Gray = nb::ndarray<const std::uint8_t, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using Colour = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using Disparity = nb::ndarray<const std::int16_t, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using LensRow = nb::ndarray<const double, nb::shape<Lens::row_size>, nb::c_contig, nb::device::cpu>;
using Matrix3 = nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;
using Point = nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>;
using Image = nb::ndarray<const float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using Layers = nb::ndarray<const float, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using Counts = nb::ndarray<std::uint8_t, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using Marks = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using PlaneNumbers = nb::ndarray<const std::int32_t, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
using Shape = std::array<int, 3>;
using Places = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using InBricks = nb::ndarray<float, nb::shape<-1, brick_size, brick_size, brick_size>, nb::c_contig, nb::device::cpu>;
using CountsInBricks =
    nb::ndarray<std::uint8_t, nb::shape<-1, brick_size, brick_size, brick_size>, nb::c_contig, nb::device::cpu>;
using ColourInBricks =
    nb::ndarray<float, nb::shape<-1, brick_size, brick_size, brick_size, -1>, nb::c_contig, nb::device::cpu>;
using Directions = Table<3>;
using Labels = nb::ndarray<const std::int32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using GridRow = nb::ndarray<const double, nb::shape<6>, nb::c_contig, nb::device::cpu>;

// from_baseline, column_step, from_axis, row_step, rows, columns
static SphericalGrid as_grid(const GridRow& row) {
    return {row(0), row(1), row(2), row(3), static_cast<int>(row(4)), static_cast<int>(row(5))};
}

static auto rectify_view(Gray image, LensRow lens, Matrix3 R_camera_grid, GridRow grid_row) {
    const SphericalGrid grid = as_grid(grid_row);
    auto out = new_array<std::uint8_t>({static_cast<std::size_t>(grid.rows), static_cast<std::size_t>(grid.columns)});
    nb::gil_scoped_release release;
    rectify(image.data(), Lens(lens.data()), R_camera_grid.data(), grid, out.data());
    return out;
}

static nb::tuple inverse_range_view(Disparity disparity, Disparity nearest, GridRow grid, Matrix3 R_camera_grid,
                                    double baseline_m, Matrix4 T_partner_camera, LensRow partner, Rays rays,
                                    double disparity_std_px, double largest_relative_std, double deviations) {
    auto value = new_array<float>({rays.shape(0), rays.shape(1)});
    auto deviation = new_array<float>({rays.shape(0), rays.shape(1)});
    auto bound = new_array<float>({rays.shape(0), rays.shape(1)});
    const StereoPair pair{baseline_m, T_partner_camera.data(), disparity_std_px, largest_relative_std, deviations};
    {
        nb::gil_scoped_release release;
        inverse_range(disparity.data(), nearest.data(), as_grid(grid), R_camera_grid.data(), pair, Lens(partner.data()),
                      rays.data(), static_cast<int>(rays.shape(0) * rays.shape(1)), value.data(), deviation.data(),
                      bound.data());
    }
    return nb::make_tuple(value, deviation, bound);
}

static auto nearest_disparity_view(Gray left, Gray right, Disparity disparity, int disparities, double noise,
                                   double deviations, double mean) {
    auto nearest = new_array<std::int16_t>({disparity.shape(0), disparity.shape(1)});
    nb::gil_scoped_release release;
    nearest_disparity(left.data(), right.data(), disparity.data(), static_cast<int>(disparity.shape(0)),
                      static_cast<int>(disparity.shape(1)), disparities, {noise, deviations, mean}, nearest.data());
    return nearest;
}

static nb::tuple sweep_lines_view(Directions first, Directions last, Directions partner_first, Directions partner_last,
                                  Labels partner, Directions offset_m, double std_rad, double tolerance,
                                  double nearest_m, double farthest_m, double largest_relative_std,
                                  double least_overlap, int threads) {
    auto inverse_range = new_array<double>({first.shape(0), 2});
    auto deviation = new_array<double>({first.shape(0)});
    auto agreeing = new_array<std::uint8_t>({first.shape(0)}), rivals = new_array<std::uint8_t>({first.shape(0)});
    const Segments mine{static_cast<int>(first.shape(0)), first.data(), last.data()};
    const Segments theirs{static_cast<int>(partner_first.shape(0)), partner_first.data(), partner_last.data()};
    {
        nb::gil_scoped_release release;
        sweep_lines(mine, {theirs, partner.data(), static_cast<int>(offset_m.shape(0)), offset_m.data()},
                    {std_rad, tolerance, nearest_m, farthest_m, largest_relative_std, least_overlap}, threads,
                    inverse_range.data(), deviation.data(), agreeing.data(), rivals.data());
    }
    return nb::make_tuple(inverse_range, deviation, agreeing, rivals);
}

static nb::tuple fuse_layers(Layers values, Layers deviations, double tolerance, int least) {
    auto value = new_array<float>({values.shape(1), values.shape(2)});
    auto deviation = new_array<float>({values.shape(1), values.shape(2)});
    {
        nb::gil_scoped_release release;
        fuse(values.data(), deviations.data(), static_cast<int>(values.shape(0)),
             static_cast<int>(values.shape(1) * values.shape(2)), tolerance, least, value.data(), deviation.data());
    }
    return nb::make_tuple(value, deviation);
}

static auto facing_view(Image inverse_range, Rays rays, int step, float unsure) {
    auto cosine = new_array<float>({inverse_range.shape(0), inverse_range.shape(1)});
    nb::gil_scoped_release release;
    facing(inverse_range.data(), rays.data(), static_cast<int>(rays.shape(0)), static_cast<int>(rays.shape(1)), step,
           unsure, cosine.data());
    return cosine;
}

static VoxelGrid as_voxels(const Point& origin, double voxel, const Shape& shape) {
    return {{origin(0), origin(1), origin(2)}, voxel, {shape[0], shape[1], shape[2]}};
}

static Volume as_volume(const VoxelGrid& grid, const Places& bricks, const InBricks& distance, const InBricks& weight,
                        const InBricks& scatter, const CountsInBricks& images, const ColourInBricks& colour,
                        const InBricks& colour_weight) {
    return {grid,
            static_cast<int>(bricks.shape(0)),
            bricks.data(),
            distance.data(),
            weight.data(),
            scatter.data(),
            images.data(),
            colour.data(),
            colour_weight.data(),
            static_cast<int>(colour.shape(4))};
}

static void mark_near_surface_view(Point origin, double voxel, Shape shape, Counts near, Image inverse_range,
                                   Image facing_image, LensRow lens, Rays rays, Matrix4 T_world_camera,
                                   double truncation, double farthest) {
    const RangeImage image{inverse_range.data(), nullptr, facing_image.data(), nullptr, Lens(lens.data())};
    nb::gil_scoped_release release;
    mark_near_surface(as_voxels(origin, voxel, shape), image, rays.data(), T_world_camera.data(),
                      {truncation, farthest}, near.data());
}

static void integrate_view(Point origin, double voxel, Shape shape, Places bricks, InBricks distance, InBricks weight,
                           InBricks scatter, CountsInBricks images, ColourInBricks colour, InBricks colour_weight,
                           Image inverse_range, Image deviation, Image facing_image, Colour pixels, LensRow lens,
                           Matrix4 T_camera_world, double truncation, double farthest, int threads) {
    const Volume volume =
        as_volume(as_voxels(origin, voxel, shape), bricks, distance, weight, scatter, images, colour, colour_weight);
    const RangeImage image{inverse_range.data(), deviation.data(), facing_image.data(), pixels.data(),
                           Lens(lens.data())};
    nb::gil_scoped_release release;
    integrate(volume, image, T_camera_world.data(), {truncation, farthest}, threads);
}

static void carve_view(Point origin, double voxel, Counts seen_through, Image bound, LensRow lens,
                       Matrix4 T_camera_world, double margin, double farthest, int enough, int threads) {
    const Shape shape{static_cast<int>(seen_through.shape(0)), static_cast<int>(seen_through.shape(1)),
                      static_cast<int>(seen_through.shape(2))};
    nb::gil_scoped_release release;
    carve(as_voxels(origin, voxel, shape), bound.data(), Lens(lens.data()), T_camera_world.data(), margin, farthest,
          enough, threads, seen_through.data());
}

static auto surface_ranges_view(Point origin, double voxel, PlaneNumbers number, Marks filled, Table<6> plane,
                                Rays rays, Matrix4 T_world_camera, double farthest) {
    const Shape shape{static_cast<int>(number.shape(0)), static_cast<int>(number.shape(1)),
                      static_cast<int>(number.shape(2))};
    auto range = new_array<float>({rays.shape(0), rays.shape(1)});
    nb::gil_scoped_release release;
    surface_ranges({as_voxels(origin, voxel, shape), number.data(), filled.data(), plane.data()}, rays.data(),
                   static_cast<int>(rays.shape(0) * rays.shape(1)), T_world_camera.data(), farthest, range.data());
    return range;
}

static ShownSurface as_shown(const Gray& grey, const Image& range, const LensRow& lens) {
    return {grey.data(), range.data(), static_cast<int>(range.shape(1)), static_cast<int>(range.shape(0)),
            Lens(lens.data())};
}

static auto match_through_surface_view(Gray grey, Image range, LensRow lens, Rays rays, Gray partner_grey,
                                       Image partner_range, LensRow partner_lens, Matrix4 T_partner_camera, int step) {
    auto matched = new_array<float>({grey.shape(0) / step, grey.shape(1) / step});
    nb::gil_scoped_release release;
    match_through_surface(as_shown(grey, range, lens), rays.data(), as_shown(partner_grey, partner_range, partner_lens),
                          T_partner_camera.data(), step, matched.data());
    return matched;
}

static void compare_through_surface_view(Counts counts, Gray grey, Image range, LensRow lens, Rays rays, Gray least,
                                         Gray most, Image partner_range, LensRow partner_lens, Matrix4 T_partner_camera,
                                         Image gain, int step, double allowed, int enough) {
    nb::gil_scoped_release release;
    compare_through_surface(as_shown(grey, range, lens), rays.data(), as_shown(least, partner_range, partner_lens),
                            T_partner_camera.data(), {least.data(), most.data(), gain.data(), step, allowed, enough},
                            counts.data());
}

static void count_looks_view(Point origin, double voxel, Marks marked, Counts looks, Counts contradictions,
                             Gray verdict, Image range, LensRow lens, Matrix4 T_camera_world, double nearest,
                             double farthest, double margin, double least_tested, int least_pixels, double least_share,
                             double least_rate, int threads) {
    const Shape shape{static_cast<int>(marked.shape(0)), static_cast<int>(marked.shape(1)),
                      static_cast<int>(marked.shape(2))};
    nb::gil_scoped_release release;
    count_looks(as_voxels(origin, voxel, shape), marked.data(), verdict.data(), as_shown(verdict, range, lens),
                T_camera_world.data(), {nearest, farthest, margin, least_tested, least_pixels, least_share, least_rate},
                threads, looks.data(), contradictions.data());
}

static nb::tuple marching_cubes_view(Point origin, double voxel, Shape shape, Places bricks, InBricks distance,
                                     InBricks weight, InBricks scatter, CountsInBricks images, ColourInBricks colour,
                                     InBricks colour_weight, double least_weight) {
    const Volume volume =
        as_volume(as_voxels(origin, voxel, shape), bricks, distance, weight, scatter, images, colour, colour_weight);
    Mesh mesh;
    {
        nb::gil_scoped_release release;
        mesh = marching_cubes(volume, least_weight);
    }
    auto vertices = new_array<double>({mesh.vertices.size(), 3});
    auto faces = new_array<std::int32_t>({mesh.faces.size(), 3});
    auto colours = new_array<float>({mesh.vertices.size(), static_cast<std::size_t>(volume.channels)});
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
        for (int axis = 0; axis < 3; ++axis) vertices.data()[3 * i + axis] = mesh.vertices[i][axis];
    for (std::size_t i = 0; i < mesh.faces.size(); ++i)
        for (int n = 0; n < 3; ++n) faces.data()[3 * i + n] = mesh.faces[i][n];
    std::copy(mesh.colours.begin(), mesh.colours.end(), colours.data());
    auto weights = new_array<float>({mesh.vertices.size()}), scatters = new_array<float>({mesh.vertices.size()});
    auto counts = new_array<std::uint8_t>({mesh.vertices.size()});
    std::copy(mesh.weights.begin(), mesh.weights.end(), weights.data());
    std::copy(mesh.scatters.begin(), mesh.scatters.end(), scatters.data());
    std::copy(mesh.images.begin(), mesh.images.end(), counts.data());
    return nb::make_tuple(vertices, faces, colours, weights, scatters, counts);
}

NB_MODULE(_mapping, m) {
    m.attr("BRICK_SIZE") = brick_size;
    m.def("rectify", &rectify_view, nb::arg("image"), nb::arg("lens"), nb::arg("R_camera_grid"), nb::arg("grid"));
    m.def("inverse_range", &inverse_range_view, nb::arg("disparity"), nb::arg("nearest"), nb::arg("grid"),
          nb::arg("R_camera_grid"), nb::arg("baseline_m"), nb::arg("T_partner_camera"), nb::arg("partner"),
          nb::arg("rays"), nb::arg("disparity_std_px"), nb::arg("largest_relative_std"), nb::arg("deviations"));
    m.def("nearest_disparity", &nearest_disparity_view, nb::arg("left"), nb::arg("right"), nb::arg("disparity"),
          nb::arg("disparities"), nb::arg("noise"), nb::arg("deviations"), nb::arg("mean"));
    m.def("sweep_lines", &sweep_lines_view, nb::arg("first"), nb::arg("last"), nb::arg("partner_first"),
          nb::arg("partner_last"), nb::arg("partner"), nb::arg("offset_m"), nb::arg("std_rad"), nb::arg("tolerance"),
          nb::arg("nearest_m"), nb::arg("farthest_m"), nb::arg("largest_relative_std"), nb::arg("least_overlap"),
          nb::arg("threads"));
    m.def("carve", &carve_view, nb::arg("origin_world_m"), nb::arg("voxel_m"), nb::arg("seen_through").noconvert(),
          nb::arg("bound"), nb::arg("lens"), nb::arg("T_camera_world"), nb::arg("margin_m"), nb::arg("farthest_m"),
          nb::arg("enough"), nb::arg("threads"));
    m.def("fuse", &fuse_layers, nb::arg("values"), nb::arg("deviations"), nb::arg("tolerance"), nb::arg("least"));
    m.def("facing", &facing_view, nb::arg("inverse_range"), nb::arg("rays"), nb::arg("step"), nb::arg("unsure"));
    m.def("mark_near_surface", &mark_near_surface_view, nb::arg("origin_world_m"), nb::arg("voxel_m"), nb::arg("shape"),
          nb::arg("near").noconvert(), nb::arg("inverse_range"), nb::arg("facing"), nb::arg("lens"), nb::arg("rays"),
          nb::arg("T_world_camera"), nb::arg("truncation_m"), nb::arg("farthest_m"));
    m.def("integrate", &integrate_view, nb::arg("origin_world_m"), nb::arg("voxel_m"), nb::arg("shape"),
          nb::arg("bricks"), nb::arg("distance").noconvert(), nb::arg("weight").noconvert(),
          nb::arg("scatter").noconvert(), nb::arg("images").noconvert(), nb::arg("colour").noconvert(),
          nb::arg("colour_weight").noconvert(), nb::arg("inverse_range"), nb::arg("deviation"), nb::arg("facing"),
          nb::arg("pixels"), nb::arg("lens"), nb::arg("T_camera_world"), nb::arg("truncation_m"), nb::arg("farthest_m"),
          nb::arg("threads"));
    m.def("marching_cubes", &marching_cubes_view, nb::arg("origin_world_m"), nb::arg("voxel_m"), nb::arg("shape"),
          nb::arg("bricks"), nb::arg("distance").noconvert(), nb::arg("weight").noconvert(),
          nb::arg("scatter").noconvert(), nb::arg("images").noconvert(), nb::arg("colour").noconvert(),
          nb::arg("colour_weight").noconvert(), nb::arg("least_weight"));
    m.def("surface_ranges", &surface_ranges_view, nb::arg("origin_world_m"), nb::arg("voxel_m"), nb::arg("number"),
          nb::arg("filled"), nb::arg("plane"), nb::arg("rays"), nb::arg("T_world_camera"), nb::arg("farthest_m"));
    m.def("match_through_surface", &match_through_surface_view, nb::arg("grey"), nb::arg("range_m"), nb::arg("lens"),
          nb::arg("rays"), nb::arg("partner_grey"), nb::arg("partner_range_m"), nb::arg("partner_lens"),
          nb::arg("T_partner_camera"), nb::arg("step"));
    m.def("compare_through_surface", &compare_through_surface_view, nb::arg("counts").noconvert(), nb::arg("grey"),
          nb::arg("range_m"), nb::arg("lens"), nb::arg("rays"), nb::arg("least"), nb::arg("most"),
          nb::arg("partner_range_m"), nb::arg("partner_lens"), nb::arg("T_partner_camera"), nb::arg("gain"),
          nb::arg("step"), nb::arg("allowed"), nb::arg("enough"));
    m.def("count_looks", &count_looks_view, nb::arg("origin_world_m"), nb::arg("voxel_m"), nb::arg("marked"),
          nb::arg("looks").noconvert(), nb::arg("contradictions").noconvert(), nb::arg("verdict"), nb::arg("range_m"),
          nb::arg("lens"), nb::arg("T_camera_world"), nb::arg("nearest_m"), nb::arg("farthest_m"), nb::arg("margin_m"),
          nb::arg("least_tested"), nb::arg("least_pixels"), nb::arg("least_share"), nb::arg("least_rate"),
          nb::arg("threads"));
}
