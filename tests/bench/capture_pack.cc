#include "tests/bench/capture_pack.h"

#include <zlib.h>

#include <algorithm>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

constexpr uint64_t kMagic = 0x31706163'65706570;  // "pepecap1"

// One walk over the fields serves both ways.
class Pack {
 public:
  Pack(const std::string& path, bool writing)
      : file_(gzopen(path.c_str(), writing ? "wb6" : "rb")), writing_(writing) {
    ok_ = file_ != nullptr;
  }
  ~Pack() {
    if (file_ != nullptr) gzclose(file_);
  }
  Pack(const Pack&) = delete;
  Pack& operator=(const Pack&) = delete;

  bool ok() const { return ok_; }

  template <class T>
  void Value(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    Bytes(&value, sizeof(T));
  }
  template <class Items>  // std::string or a vector of plain elements
  void Array(Items& items) {
    uint64_t size = items.size();
    Value(size);
    if (!writing_ && ok_) items.resize(size);
    Bytes(items.data(), items.size() * sizeof(items[0]));
  }

 private:
  void Bytes(void* data, size_t size) {
    constexpr size_t kMost = 1 << 24;  // gzread counts in ints
    for (size_t done = 0; ok_ && done < size;) {
      const auto part = static_cast<unsigned>(std::min(kMost, size - done));
      char* at = static_cast<char*>(data) + done;
      ok_ =
          (writing_ ? gzwrite(file_, at, part) : gzread(file_, at, part)) == static_cast<int>(part);
      done += part;
    }
  }

  gzFile file_;
  bool writing_, ok_;
};

void WalkView(Pack& pack, View& view) {
  pack.Array(view.name);
  pack.Value(view.camera);
  for (int k = 0; k < 4; ++k) pack.Value(view.cam_from_world.rotation.coeffs()[k]);
  for (int k = 0; k < 3; ++k) pack.Value(view.cam_from_world.translation[k]);
  pack.Value(view.held_out);
  pack.Value(view.photo.width);
  pack.Value(view.photo.height);
  pack.Value(view.photo.channels);
  pack.Array(view.photo.pixels);
  pack.Array(view.ignore);
  pack.Value(view.masks.width);
  pack.Value(view.masks.height);
  pack.Value(view.masks.num_masks);
  pack.Value(view.masks.words);
  pack.Array(view.masks.pixel_patch);
  pack.Array(view.masks.patch_bits);
  pack.Array(view.masks.mask_area);
  pack.Value(view.depth.kind);
  pack.Array(view.depth.values);
}

void WalkPoint(Pack& pack, ScenePoint& point) {
  for (int k = 0; k < 3; ++k) pack.Value(point.position[k]);
  pack.Value(point.rgb);
}

bool Walk(Pack& pack, Capture& capture) {
  uint64_t magic = kMagic, num_views = capture.views.size(), num_points = capture.points.size();
  pack.Value(magic);
  pack.Value(num_views);
  pack.Value(num_points);
  if (!pack.ok() || magic != kMagic) return false;
  capture.views.resize(num_views);
  capture.points.resize(num_points);
  for (View& view : capture.views) WalkView(pack, view);
  for (ScenePoint& point : capture.points) WalkPoint(pack, point);
  return pack.ok();
}

}  // namespace

absl::Status WriteCapturePack(const std::string& path, const Capture& capture) {
  Pack pack(path, true);
  Capture copy = capture;
  if (Walk(pack, copy)) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(path, ": cannot be written"));
}

absl::StatusOr<Capture> ReadCapturePack(const std::string& path) {
  Pack pack(path, false);
  Capture capture;
  if (Walk(pack, capture)) return capture;
  return absl::InvalidArgumentError(absl::StrCat(path, ": not a whole capture pack"));
}

}  // namespace pepeseg
