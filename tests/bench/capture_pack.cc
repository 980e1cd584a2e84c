#include "tests/bench/capture_pack.h"

#include <zlib.h>

#include <algorithm>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

constexpr uint64_t kMagic = 0x32706163'65706570;  // "pepecap2"

// A single walk over the fields serves reading and writing.
class PackFile {
 public:
  PackFile(const std::string& path, const char* mode)
      : file_(gzopen(path.c_str(), mode)), writing_(mode[0] == 'w') {
    ok_ = file_ != nullptr;
  }
  ~PackFile() {
    if (file_ != nullptr) gzclose(file_);
  }
  PackFile(const PackFile&) = delete;
  PackFile& operator=(const PackFile&) = delete;

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
  template <class Items, class WalkItem>
  void Each(Items& items, WalkItem walk) {
    uint64_t size = items.size();
    Value(size);
    if (!writing_ && ok_) items.resize(size);
    for (auto& item : items) walk(item);
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

void WalkView(PackFile& file, View& view) {
  file.Array(view.name);
  file.Value(view.camera);
  for (int k = 0; k < 4; ++k) file.Value(view.cam_from_world.rotation.coeffs()[k]);
  for (int k = 0; k < 3; ++k) file.Value(view.cam_from_world.translation[k]);
  file.Value(view.held_out);
  file.Value(view.photo.width);
  file.Value(view.photo.height);
  file.Value(view.photo.channels);
  file.Array(view.photo.pixels);
  file.Array(view.ignore);
  file.Value(view.masks.width);
  file.Value(view.masks.height);
  file.Value(view.masks.num_masks);
  file.Value(view.masks.words);
  file.Array(view.masks.pixel_cell);
  file.Array(view.masks.cell_bits);
  file.Array(view.masks.mask_area);
  file.Value(view.depth.kind);
  file.Array(view.depth.values);
}

void WalkPoint(PackFile& file, ScenePoint& point) {
  for (int k = 0; k < 3; ++k) file.Value(point.position[k]);
  file.Value(point.rgb);
}

void WalkLevel(PackFile& file, TruthLevel& level) {
  file.Array(level.name);
  file.Each(level.entities, [&](std::string& name) { file.Array(name); });
  file.Each(level.labels, [&](std::vector<uint16_t>& labels) { file.Array(labels); });
}

bool Walk(PackFile& file, CapturePack& pack) {
  uint64_t magic = kMagic;
  file.Value(magic);
  if (!file.ok() || magic != kMagic) return false;
  file.Each(pack.capture.views, [&](View& view) { WalkView(file, view); });
  file.Each(pack.capture.points, [&](ScenePoint& point) { WalkPoint(file, point); });
  file.Each(pack.truth, [&](TruthLevel& level) { WalkLevel(file, level); });
  return file.ok();
}

}  // namespace

absl::Status WriteCapturePack(const std::string& path, const CapturePack& pack, bool compressed) {
  PackFile file(path, compressed ? "wb6" : "wbT");
  CapturePack copy = pack;
  if (Walk(file, copy)) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(path, ": cannot be written"));
}

absl::StatusOr<CapturePack> ReadCapturePack(const std::string& path) {
  PackFile file(path, "rb");
  CapturePack pack;
  if (Walk(file, pack)) return pack;
  return absl::InvalidArgumentError(absl::StrCat(path, ": not a whole capture pack of this build"));
}

}  // namespace pepeseg
