// tc_link as nanobind sees it: bytes in, bytes out, on a controller that Python holds too.
#include "link_binding.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <tuple>
#include <vector>

#include "controller_binding.h"
#include "goshawk_controller/link.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace goshawk {
namespace {

template <int64_t n>
using Row = nb::ndarray<const double, nb::numpy, nb::shape<n>, nb::c_contig, nb::device::cpu>;

const uint8_t* data_of(const nb::bytes& bytes) { return reinterpret_cast<const uint8_t*>(bytes.c_str()); }

nb::bytes bytes_of(const void* data, size_t n) { return nb::bytes(static_cast<const char*>(data), n); }

class Link {
  public:
    Link(Controller& controller, std::optional<nb::bytes> key, uint8_t system_id, uint64_t start_10us, uint32_t boot_id,
         uint32_t bytes_per_s, uint32_t log_records, uint32_t log_period_us, uint64_t now_us,
         uint32_t signature_checks_per_s, uint32_t commit_slices)
        : log_(static_cast<size_t>(log_records) * TC_LINK_RECORD) {
        config_.system_id = system_id;
        config_.component_id = 1;
        config_.sign = key.has_value();
        if (key) std::memcpy(config_.key, key->c_str(), std::min<size_t>(key->size(), TC_KEY_BYTES));
        config_.start_10us = start_10us;
        config_.boot_id = boot_id;
        config_.bytes_per_s = bytes_per_s;
        config_.log = log_.data();
        config_.log_records = log_records;
        config_.log_period_us = log_period_us;
        config_.signature_checks_per_s = signature_checks_per_s;
        config_.commit_slices = commit_slices;
        tc_link_init(link_.get(), controller.c.get(), &config_, now_us);
    }

    uint32_t receive(const nb::bytes& bytes, bool datagram, uint64_t now_us) {
        const uint32_t before = link_->counts.accepted;
        tc_link_receive(link_.get(), data_of(bytes), bytes.size(), datagram ? nullptr : &stream_, now_us);
        return link_->counts.accepted - before;
    }

    void update(uint64_t now_us) { tc_link_update(link_.get(), now_us); }

    nb::bytes transmit(uint64_t now_us) {
        uint8_t frame[TC_FRAME_MAX];
        return bytes_of(frame, tc_link_transmit(link_.get(), frame, now_us));
    }

    nb::dict counts() const {
        const tc_link_counts& c = link_->counts;
        nb::dict d;
        d["accepted"] = c.accepted;
        d["without_signature"] = c.without_signature;
        d["wrong_key"] = c.wrong_key;
        d["replayed"] = c.replayed;
        d["unopened"] = c.unopened;
        d["over_budget"] = c.over_budget;
        d["not_for_us"] = c.not_for_us;
        d["sent"] = c.sent;
        d["checksum_errors"] = c.faults.checksum_errors;
        d["unknown"] = c.faults.unknown;
        return d;
    }

    uint64_t stamp_to_keep() const { return tc_link_stamp_to_keep(link_.get()); }

    // What a vehicle keeps in permanent memory.
    std::optional<nb::bytes> kept() const {
        const tc_trajectory* active = tc_store_active(&link_->controller->store);
        if (active == nullptr) return std::nullopt;
        return bytes_of(active, sizeof *active);
    }

    int restore(const nb::bytes& bytes) {
        if (bytes.size() != sizeof(tc_trajectory)) return TC_OUT_OF_RANGE;
        auto kept = std::make_unique<tc_trajectory>();
        std::memcpy(kept.get(), bytes.c_str(), sizeof *kept);
        return tc_link_restore(link_.get(), kept.get());
    }

  private:
    tc_link_config config_{};
    tc_parser stream_{};
    std::unique_ptr<tc_link> link_ = std::make_unique<tc_link>();
    std::vector<uint8_t> log_;
};

nb::bytes sha256(const nb::bytes& bytes) {
    tc_sha256 hash;
    uint8_t digest[32];
    tc_sha256_init(&hash);
    tc_sha256_update(&hash, data_of(bytes), bytes.size());
    tc_sha256_final(&hash, digest);
    return bytes_of(digest, sizeof digest);
}

}  // namespace

void bind_link(nb::module_& m) {
    m.def("sha256", &sha256, "data"_a);
    nb::class_<Link>(m, "Link")
        .def(nb::init<Controller&, std::optional<nb::bytes>, uint8_t, uint64_t, uint32_t, uint32_t, uint32_t, uint32_t,
                      uint64_t, uint32_t, uint32_t>(),
             "controller"_a, "key"_a.none(), "system_id"_a, "start_10us"_a, "boot_id"_a, "bytes_per_s"_a,
             "log_records"_a, "log_period_us"_a, "now_us"_a, "signature_checks_per_s"_a = 0, "commit_slices"_a = 0,
             nb::keep_alive<1, 2>())
        .def("receive", &Link::receive, "data"_a, "datagram"_a, "now_us"_a)
        .def("update", &Link::update, "now_us"_a)
        .def("transmit", &Link::transmit, "now_us"_a)
        .def("counts", &Link::counts)
        .def("stamp_to_keep", &Link::stamp_to_keep)
        .def("kept", &Link::kept)
        .def("restore", &Link::restore, "kept"_a);
}

}  // namespace goshawk
