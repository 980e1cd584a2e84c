#include "server/services/render_answer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"

namespace pepeseg {
namespace {

constexpr double kDeepest = 65'535;  // the largest value of 16 bits
// Size of an answer whose request does not say one, which a renderer keeps memory for.
constexpr int64_t kDefaultPixels = int64_t{1920} * 1080;

// A request in the model's terms.
struct RenderQuery {
  RenderRequest asked;
  bool may_shrink = false;  // until the image fits into a message
};

// An image to encode. `depth_unit`: what a step of a depth image is in units of the scene; 0 for
// the other contents.
struct Picture {
  std::variant<Image, Grey16Image> pixels;
  double depth_unit = 0;
};

// Returns the size of the answer that is asked for, as a share of the full size in (0, 1].
double ShareAskedFor(const ModelView& view, const Frame& frame, int max_side) {
  if (max_side > 0) {
    return std::min(1.0, static_cast<double>(max_side) / std::max(frame.width(), frame.height()));
  }
  if (view.name.empty()) return 1;  // a free camera has the size that it says
  const double num_pixels = static_cast<double>(frame.width()) * frame.height();
  return std::min(1.0, std::sqrt(static_cast<double>(kDefaultPixels) / num_pixels));
}

RenderContent ContentFromProto(v1::RenderViewRequest::Content content) {
  switch (content) {
    case v1::RenderViewRequest::CONTENT_DEPTH:
      return RenderContent::kDepth;
    case v1::RenderViewRequest::CONTENT_SEGMENTS:
      return RenderContent::kSegments;
    case v1::RenderViewRequest::CONTENT_FEATURES:
      return RenderContent::kFeatures;
    default:
      return RenderContent::kColor;
  }
}

// Checks the fields that can be checked without the model.
absl::Status CheckRequest(const v1::RenderViewRequest& request) {
  if (!v1::RenderViewRequest::Content_IsValid(request.content())) {
    return BadField("content", absl::StrCat(static_cast<int>(request.content())), "no content");
  }
  const bool is_color = request.content() == v1::RenderViewRequest::CONTENT_UNSPECIFIED ||
                        request.content() == v1::RenderViewRequest::CONTENT_COLOR;
  if (request.overlay_case() != v1::RenderViewRequest::OVERLAY_NOT_SET && !is_color) {
    return BadField("overlay", v1::RenderViewRequest::Content_Name(request.content()),
                    "only CONTENT_COLOR has an overlay");
  }
  if (request.max_side() < 0 || request.max_side() > kMaxViewSide) {
    return BadField("max_side", absl::StrCat(request.max_side()),
                    absl::StrCat("not in [0, ", kMaxViewSide, "]"));
  }
  return CheckFrame(request.frame());
}

// Reads the overlay mask, which has the size of the frame or of the answer.
absl::Status ReadOverlay(const v1::MaskImage& mask, RenderRequest& asked) {
  asked.overlay_size = SizeOf(mask);
  Frame expected(asked.view, asked.frame);
  // A client may draw on the picture that it got, which has the answer's size, or on the photograph
  // itself.
  const ImageSize answer = asked.Size();
  if (asked.overlay_size == answer) expected = expected.Resized(answer);
  ASSIGN_OR_RETURN(asked.overlay, ReadMask(mask, expected, "overlay_mask"));
  return AtField(CheckNotEmpty(*asked.overlay), "overlay_mask");
}

absl::StatusOr<RenderQuery> ReadQuery(const NamedScenes& scenes, const Selections& selections,
                                      const ResidentModel& model,
                                      const v1::RenderViewRequest& request) {
  RETURN_IF_ERROR(CheckRequest(request));
  RenderQuery query;
  RenderRequest& asked = query.asked;
  ASSIGN_OR_RETURN(asked.view, FindViewpoint(request.viewpoint(), model->model(), "viewpoint"));
  asked.frame = FrameKindFromProto(request.frame());
  asked.content = ContentFromProto(request.content());
  asked.share = ShareAskedFor(asked.view, Frame(asked.view, asked.frame), request.max_side());
  // A size that the client gave is kept, and CheckAnswerSize then refuses an image that is too
  // large.
  query.may_shrink = request.max_side() == 0 && !asked.view.name.empty();
  if (asked.content == RenderContent::kSegments) {
    ASSIGN_OR_RETURN(asked.scales,
                     ReadScales(request.decomposition_scales(), "decomposition_scales"));
    RETURN_IF_ERROR(CheckLevelField(request.level(), asked.scales.size(), "level"));
    asked.level = request.level();
  }
  asked.feature_scale = request.feature_scale();
  if (asked.content == RenderContent::kFeatures && !CheckScale(asked.feature_scale).ok()) {
    return BadField("feature_scale", absl::StrCat(asked.feature_scale), "not in [0, 1]");
  }
  ASSIGN_OR_RETURN(asked.subset, selections.FindSubset(scenes, model, request.subset(), "subset"));
  if (request.has_overlay_mask()) {
    RETURN_IF_ERROR(ReadOverlay(request.overlay_mask(), asked));
  } else if (request.has_overlay_subset()) {
    ASSIGN_OR_RETURN(
        asked.overlay_set,
        selections.FindSubset(scenes, model, request.overlay_subset(), "overlay_subset"));
    // Here "all of the model" would tint the whole picture, so it is refused.
    if (!asked.overlay_set) {
      return BadField("overlay_subset", "", "neither a selection nor a segment");
    }
  }
  return query;
}

// Returns depth in units that make the deepest pixel 65535.
Picture DepthPicture(const RenderedView& rendered, Grey16Image image) {
  const std::vector<float>& depth = rendered.depth;
  const double deepest = depth.empty() ? 0 : *std::max_element(depth.begin(), depth.end());
  // An image without depth gets a unit over 0, since clients divide by it.
  const double unit = (deepest > 0 ? deepest : 1) / kDeepest;
  for (const float value : depth) {
    // 0 means that nothing is there, so the smallest depth becomes 1.
    const double steps = std::clamp(double{value} / unit, value > 0 ? 1.0 : 0.0, kDeepest);
    image.pixels.push_back(static_cast<uint16_t>(std::lround(steps)));
  }
  return {std::move(image), unit};
}

Picture PictureOf(RenderContent content, RenderedView rendered) {
  Grey16Image grey = {
      static_cast<int>(rendered.size.width), static_cast<int>(rendered.size.height), {}};
  if (content == RenderContent::kDepth) return DepthPicture(rendered, std::move(grey));
  if (content != RenderContent::kSegments) return {std::move(rendered.color)};
  grey.pixels.assign(rendered.ids.begin(), rendered.ids.end());
  return {std::move(grey)};
}

// Renders the answer into `response`, with the times of computing and encoding. If the request does
// not say a size, renders it smaller until it fits into a message.
absl::Status RenderToFit(const UnaryCall& call, const SceneModel& model, RenderQuery query,
                         v1::RenderViewResponse* response) {
  constexpr size_t kRest = 1024;  // bytes of the answer that are not the image
  // A smaller image has more detail in each pixel, so it shrinks less than its number of pixels.
  constexpr double kSpare = 0.8;
  Stopwatch stopwatch;
  absl::Duration compute, encode;
  for (;;) {
    // Before each render: every size that did not fit has cost one.
    RETURN_IF_ERROR(call.CheckWanted());
    ASSIGN_OR_RETURN(RenderedView rendered, model.Render(query.asked));
    response->set_width(static_cast<int>(rendered.size.width));
    response->set_height(static_cast<int>(rendered.size.height));
    const Picture picture = PictureOf(query.asked.content, std::move(rendered));
    compute += stopwatch.Lap();
    ASSIGN_OR_RETURN(
        *response->mutable_png(),
        std::visit([](const auto& pixels) { return EncodePng(pixels); }, picture.pixels));
    encode += stopwatch.Lap();
    response->set_depth_unit(picture.depth_unit);
    if (!query.may_shrink || response->ByteSizeLong() + kRest <= kAnswerBytes) break;
    const auto excess =
        static_cast<double>(kAnswerBytes) / static_cast<double>(response->png().size());
    query.asked.share *= std::sqrt(kSpare * excess);
  }
  *response->mutable_timing()->mutable_compute() = ToProto(compute);
  *response->mutable_timing()->mutable_encode() = ToProto(encode);
  return absl::OkStatus();
}

}  // namespace

absl::Status RenderAnswers::Render(const UnaryCall& call, const v1::RenderViewRequest& request,
                                   v1::RenderViewResponse* response) const {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   models_.Load(call.scenes(), request.model(), "model"));
  if (request.content() == v1::RenderViewRequest::CONTENT_SEGMENTS ||
      request.content() == v1::RenderViewRequest::CONTENT_FEATURES) {
    RETURN_IF_ERROR(CheckFeatures(model));
  }
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  ASSIGN_OR_RETURN(RenderQuery query, ReadQuery(call.scenes(), selections_, model, request));
  RETURN_IF_ERROR(RenderToFit(call, *model, std::move(query), response));
  SetModel(model, response);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
