#include "clients/cli/accepted_mask.h"

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"

namespace pepeseg::client::cli {
namespace {

std::string LabelIdOf(const std::string& name) { return name.substr(name.rfind('/') + 1); }

// Number of pixels of a mask, 0 or 1 each, and the smallest box around them.
struct MaskExtent {
  int64_t area = 0;
  int x = 0, y = 0, width = 0, height = 0;
};

MaskExtent ExtentOf(const Mask& mask, const PixelSize& size) {
  MaskExtent extent{0, size.width, size.height, 0, 0};
  int right = 0, bottom = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (mask[static_cast<size_t>(y) * size.width + x] == 0) continue;
      ++extent.area;
      extent.x = std::min(extent.x, x), extent.y = std::min(extent.y, y);
      right = std::max(right, x + 1), bottom = std::max(bottom, y + 1);
    }
  }
  if (extent.area == 0) return {};
  extent.width = right - extent.x, extent.height = bottom - extent.y;
  return extent;
}

}  // namespace

absl::Status TakeAcceptedMask(const Client& client, const v1::SegmentViewsRequest& request,
                              v1::SegmentViewsResponse& answer) {
  const v1::Granularity& granularity = request.granularity();
  if (request.prompt().label().empty() || granularity.has_threshold() ||
      granularity.scale_case() != v1::Granularity::SCALE_NOT_SET) {
    return absl::OkStatus();
  }
  std::string scene = SceneOf(request.model());
  if (scene.empty()) scene = SceneOf(answer.model());  // a job was named
  if (scene.empty()) return absl::OkStatus();
  const std::string name = absl::StrCat(scene, "/labels/", LabelIdOf(request.prompt().label()));
  ASSIGN_OR_RETURN(const v1::Label label, client.GetLabel(name, request.frame()));
  for (v1::SegmentViewsResponse::ViewMask& found : *answer.mutable_masks()) {
    if (found.view() != label.view()) continue;
    const v1::CocoRle& rle = label.mask().rle();
    ASSIGN_OR_RETURN(const Mask mask, DecodeRle(rle));
    const MaskExtent extent = ExtentOf(mask, {rle.width(), rle.height()});
    *found.mutable_rle() = rle;
    found.set_area(extent.area);
    found.mutable_box()->set_x(extent.x);
    found.mutable_box()->set_y(extent.y);
    found.mutable_box()->set_width(extent.width);
    found.mutable_box()->set_height(extent.height);
    found.clear_border_image();
  }
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
