#include "server/services/found_to_proto.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/api/convert.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

constexpr size_t kMostAppearances = 8;

// A box in pixels of a frame.
struct FrameBox {
  int x0 = 0, y0 = 0, x1 = -1, y1 = -1;  // first and last column and scanline
};

// Returns the box in the frame around an area of a view's grid: of points along its border, since a
// lens bends its edges.
FrameBox InFrame(const Frame& frame, const SeenView& seen, const SeenArea& area) {
  constexpr int kPoints = 8;
  const Camera& camera = frame.camera();
  double x0 = frame.width(), y0 = frame.height(), x1 = 0, y1 = 0;
  for (int i = 0; i <= kPoints; ++i) {
    for (int j = 0; j <= kPoints; ++j) {
      if (i % kPoints != 0 && j % kPoints != 0) continue;
      const double u = area.x0 + (area.x1 + 1 - area.x0) * double(i) / kPoints;
      const double v = area.y0 + (area.y1 + 1 - area.y0) * double(j) / kPoints;
      const Eigen::Vector2d at = frame.FromView(
          Eigen::Vector2d(u * camera.width / seen.width, v * camera.height / seen.height));
      x0 = std::min(x0, at.x());
      x1 = std::max(x1, at.x());
      y0 = std::min(y0, at.y());
      y1 = std::max(y1, at.y());
    }
  }
  const auto first = [](double edge, int size) {
    return std::clamp(static_cast<int>(std::floor(edge)), 0, size - 1);
  };
  const auto last = [](double edge, int size) {
    return std::clamp(static_cast<int>(std::ceil(edge)) - 1, 0, size - 1);
  };
  return {first(x0, frame.width()), first(y0, frame.height()), last(x1, frame.width()),
          last(y1, frame.height())};
}

}  // namespace

void FoundWriter::AddAppearance(const SeenView& seen, int32_t segment,
                                v1::FindSegmentsResponse::Found& found) const {
  const ModelView& view = model_.views[seen.view];
  const Frame frame(view, kind_);
  const SeenArea& area = seen.areas[segment];
  const FrameBox box = InFrame(frame, seen, area);
  v1::FindSegmentsResponse::Appearance& to = *found.add_appearances();
  to.set_view(view.name);
  to.set_x(box.x0);
  to.set_y(box.y0);
  to.set_width(box.x1 - box.x0 + 1);
  to.set_height(box.y1 - box.y0 + 1);
  // A pixel of the grid stands for its share of the box.
  const double cells = double(area.x1 - area.x0 + 1) * (area.y1 - area.y0 + 1);
  to.set_area(std::max<int64_t>(
      1, std::llround(area.pixels / cells * double(to.width()) * double(to.height()))));
}

v1::Prompt FoundWriter::PromptIn(const SeenView& seen, int32_t segment) {
  const ModelView& view = model_.views[seen.view];
  const Frame frame(view, kind_);
  const FrameBox box = InFrame(frame, seen, seen.areas[segment]);
  const std::vector<int32_t>& shown = seen.shown[all_.segments[segment].key.level];
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(frame.width()) * frame.height())};
  std::vector<Eigen::Vector2f> places(frame.width());
  const float columns = static_cast<float>(seen.width) / static_cast<float>(view.camera.width);
  const float rows = static_cast<float>(seen.height) / static_cast<float>(view.camera.height);
  for (int y = box.y0; y <= box.y1; ++y) {
    frame.PlacesOfRow(y, places);
    for (int x = box.x0; x <= box.x1; ++x) {
      if (std::isnan(places[x].x())) continue;
      const int u = std::min(static_cast<int>(places[x].x() * columns), seen.width - 1);
      const int v = std::min(static_cast<int>(places[x].y() * rows), seen.height - 1);
      if (shown[static_cast<size_t>(v) * seen.width + u] != segment) continue;
      mask.pixels[static_cast<size_t>(y) * frame.width() + x] = 1;
    }
  }
  v1::Prompt prompt;
  prompt.mutable_view()->set_view(view.name);
  *prompt.mutable_mask()->mutable_rle() = RleToProto(mask, frame.width(), frame.height());
  return prompt;
}

v1::SegmentRef RefOf(const SceneSegments& all, int32_t segment) {
  const SceneSegments::Segment* of = &all.segments[segment];
  if (of->is_piece && of->parent >= 0 &&
      all.segments[of->parent].num_gaussians == of->num_gaussians) {
    of = &all.segments[of->parent];
  }
  v1::SegmentRef ref;
  if (of->is_piece) {
    for (const double scale : kPieceDecompositionScales) ref.add_scales(scale);
  } else {
    for (const double scale : kDefaultDecompositionScales) ref.add_scales(scale);
  }
  ref.set_level(of->is_piece ? 0 : of->key.level - 1);
  ref.set_id(of->key.id);
  return ref;
}

void FoundWriter::Write(int32_t segment, v1::FindSegmentsResponse::Found& found) {
  const SceneSegments::Segment& of = all_.segments[segment];
  *found.mutable_segment() = RefOf(all_, segment);
  found.set_num_gaussians(of.num_gaussians);
  *found.mutable_box()->mutable_min() = VectorToProto({of.min[0], of.min[1], of.min[2]});
  *found.mutable_box()->mutable_max() = VectorToProto({of.max[0], of.max[1], of.max[2]});
  std::vector<const SeenView*> views;
  for (const SeenView& seen : all_.views) {
    if (seen.areas[segment].pixels > 0) views.push_back(&seen);
  }
  std::ranges::stable_sort(views, [&](const SeenView* a, const SeenView* b) {
    return a->areas[segment].pixels > b->areas[segment].pixels;
  });
  if (!views.empty() && !found.has_prompt()) *found.mutable_prompt() = PromptIn(*views[0], segment);
  if (views.size() > kMostAppearances) views.resize(kMostAppearances);
  for (const SeenView* const seen : views) AddAppearance(*seen, segment, found);
}

}  // namespace pepeseg
