#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/annotations/format_writers.h"
#include "core/base/status_macros.h"
#include "core/formats/png_file.h"

namespace pepeseg {
namespace {

// Writes LABEL/STEM.png for each label and view, of segments where they are seen, and things.json.
class MaskWriter final : public AnnotationWriter {
 public:
  MaskWriter(const AnnotatedScene& scene, ZipWriter& zip)
      : scene_(scene), zip_(zip), files_(FilesOfViews(scene, ".png")) {}

  absl::Status Add(const AnnotatedView& view) override {
    for (size_t t = 0; t < scene_.things.size(); ++t) {
      if (scene_.are_segments && ShowNothing(view.counts[t], view.size)) continue;
      ASSIGN_OR_RETURN(BinaryMask mask, MaskOfCounts(view.counts[t], view.size));
      for (uint8_t& pixel : mask.pixels) pixel = pixel != 0 ? 255 : 0;
      ASSIGN_OR_RETURN(const std::string png,
                       PngBytes(view.size.width, view.size.height, 1, 8, mask.pixels.data()));
      RETURN_IF_ERROR(zip_.Add(absl::StrCat(scene_.things[t].id, "/", files_[view.index]), png,
                               ZipWriter::Method::kStored));
    }
    return absl::OkStatus();
  }

  absl::Status Finish() override {
    return zip_.Add("things.json", ThingsJson(scene_), ZipWriter::Method::kDeflated);
  }

 private:
  const AnnotatedScene& scene_;
  ZipWriter& zip_;
  const std::vector<std::string> files_;
};

// Writes STEM.png with the track of each pixel, and things.json.
class IdWriter final : public AnnotationWriter {
 public:
  IdWriter(const AnnotatedScene& scene, ZipWriter& zip)
      : scene_(scene), zip_(zip), files_(FilesOfViews(scene, ".png")) {
    for (const AnnotatedThing& thing : scene.things) {
      if (thing.track > UINT8_MAX) bit_depth_ = 16;
    }
  }

  absl::Status Add(const AnnotatedView& view) override {
    // Large things first, so that small ones stay on top of them.
    std::vector<int64_t> areas(scene_.things.size());
    for (size_t t = 0; t < areas.size(); ++t) {
      if (ShowNothing(view.counts[t], view.size)) continue;
      ASSIGN_OR_RETURN(const BinaryMask mask, MaskOfCounts(view.counts[t], view.size));
      areas[t] = std::count(mask.pixels.begin(), mask.pixels.end(), 1);
    }
    std::vector<size_t> order(areas.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return areas[a] > areas[b]; });
    std::vector<uint16_t> ids(static_cast<size_t>(view.size.width) * view.size.height, 0);
    for (const size_t t : order) {
      if (areas[t] == 0) break;
      ASSIGN_OR_RETURN(const BinaryMask mask, MaskOfCounts(view.counts[t], view.size));
      for (size_t i = 0; i < ids.size(); ++i) {
        if (mask.pixels[i] != 0) ids[i] = static_cast<uint16_t>(scene_.things[t].track);
      }
    }
    const std::vector<uint8_t> narrow(ids.begin(), ids.end());
    const auto* const samples =
        bit_depth_ == 8 ? narrow.data() : reinterpret_cast<const uint8_t*>(ids.data());
    ASSIGN_OR_RETURN(const std::string png,
                     PngBytes(view.size.width, view.size.height, 1, bit_depth_, samples));
    return zip_.Add(files_[view.index], png, ZipWriter::Method::kStored);
  }

  absl::Status Finish() override {
    return zip_.Add("things.json", ThingsJson(scene_), ZipWriter::Method::kDeflated);
  }

 private:
  const AnnotatedScene& scene_;
  ZipWriter& zip_;
  const std::vector<std::string> files_;
  int bit_depth_ = 8;
};

}  // namespace

std::unique_ptr<AnnotationWriter> MakeMaskWriter(const AnnotatedScene& scene, ZipWriter& zip) {
  return std::make_unique<MaskWriter>(scene, zip);
}

std::unique_ptr<AnnotationWriter> MakeIdWriter(const AnnotatedScene& scene, ZipWriter& zip) {
  return std::make_unique<IdWriter>(scene, zip);
}

}  // namespace pepeseg
