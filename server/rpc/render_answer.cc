#include "server/rpc/render_answer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/io/encode_png.h"
#include "core/status_macros.h"
#include "server/rpc/answer_size.h"
#include "server/rpc/error.h"
#include "server/rpc/model_lookup.h"
#include "server/rpc/overlay.h"
#include "server/rpc/read_mask.h"
#include "server/rpc/read_prompt.h"
#include "server/rpc/rows_to_proto.h"
#include "server/rpc/segment_lookup.h"
#include "server/rpc/stopwatch.h"
#include "server/rpc/subset_lookup.h"

namespace pepeseg {
namespace {

constexpr double kDeepest = 65'535;  // of 16 bits

// A request in the model's terms; what of it is used depends on its content.
struct Question {
  ModelView view;
  std::optional<GaussianSet> subset;
  std::optional<BinaryMask> overlay;
  std::vector<double> scales;
  int level = 0;
  double feature_scale = 0;

  const GaussianSet* shown() const { return subset ? &*subset : nullptr; }
};

struct Picture {
  std::variant<Image, Grey16Image> pixels;
  double depth_unit = 0;
};

// What does not need the model.
absl::Status CheckRequest(const v1::RenderRequest& request) {
  if (!v1::RenderRequest::Content_IsValid(request.content())) {
    return BadField("content", absl::StrCat(static_cast<int>(request.content())), "no content");
  }
  const bool is_color = request.content() == v1::RenderRequest::CONTENT_UNSPECIFIED ||
                        request.content() == v1::RenderRequest::CONTENT_COLOR;
  if (request.overlay_case() != v1::RenderRequest::OVERLAY_NOT_SET && !is_color) {
    return BadField("overlay", v1::RenderRequest::Content_Name(request.content()),
                    "only CONTENT_COLOR has an overlay");
  }
  return absl::OkStatus();
}

// Where most of what is shown belongs to the overlay's subset.
absl::StatusOr<BinaryMask> MaskOfSubset(const ServiceContext& context, const ResidentModel& model,
                                        const v1::Subset& subset, const Question& question) {
  ASSIGN_OR_RETURN(const std::optional<GaussianSet> members,
                   FindSubset(context, model, subset, "overlay_subset"));
  if (!members) return BadField("overlay_subset", "", "neither a selection nor a segment");
  const std::vector<int32_t> ids(members->member.begin(), members->member.end());
  ASSIGN_OR_RETURN(const std::vector<int32_t> image,
                   model.segmenter->RenderIds(question.view, ids, question.shown()));
  return BinaryMask{{image.begin(), image.end()}};
}

absl::StatusOr<Question> ReadQuestion(const ServiceContext& context, const ResidentModel& model,
                                      const v1::RenderRequest& request) {
  RETURN_IF_ERROR(CheckRequest(request));
  Question question;
  ASSIGN_OR_RETURN(question.view,
                   FindViewpoint(request.viewpoint(), model.segmenter->model(), "viewpoint"));
  if (request.content() == v1::RenderRequest::CONTENT_SEGMENTS) {
    ASSIGN_OR_RETURN(question.scales,
                     ReadScales(request.decomposition_scales(), "decomposition_scales"));
    RETURN_IF_ERROR(CheckLevelField(request.level(), question.scales.size(), "level"));
    question.level = request.level();
  }
  question.feature_scale = request.feature_scale();
  if (request.content() == v1::RenderRequest::CONTENT_FEATURES &&
      !(question.feature_scale >= 0 && question.feature_scale <= 1)) {
    return BadField("feature_scale", absl::StrCat(question.feature_scale), "not in [0, 1]");
  }
  ASSIGN_OR_RETURN(question.subset, FindSubset(context, model, request.subset(), "subset"));
  if (request.has_overlay_mask()) {
    ASSIGN_OR_RETURN(question.overlay,
                     ReadMask(request.overlay_mask(), question.view, "overlay_mask"));
  } else if (request.has_overlay_subset()) {
    ASSIGN_OR_RETURN(question.overlay,
                     MaskOfSubset(context, model, request.overlay_subset(), question));
  }
  return question;
}

absl::StatusOr<Picture> RenderColor(const Segmenter& segmenter, const Question& question) {
  ASSIGN_OR_RETURN(Image image, segmenter.RenderColor(question.view, question.shown()));
  if (question.overlay) DrawOverlay(*question.overlay, image);
  return Picture{std::move(image)};
}

// In steps that make the deepest pixel the largest number.
absl::StatusOr<Picture> RenderDepth(const Segmenter& segmenter, const Question& question) {
  ASSIGN_OR_RETURN(const std::vector<float> depth,
                   segmenter.RenderDepth(question.view, question.shown()));
  const double deepest = depth.empty() ? 0 : *std::max_element(depth.begin(), depth.end());
  const double unit = (deepest > 0 ? deepest : 1) / kDeepest;
  Grey16Image image = {question.view.camera.width, question.view.camera.height, {}};
  image.pixels.reserve(depth.size());
  for (const float value : depth) {
    const double steps = std::clamp(double{value} / unit, value > 0 ? 1.0 : 0.0, kDeepest);
    image.pixels.push_back(static_cast<uint16_t>(std::lround(steps)));
  }
  absl::StatusOr<Picture> picture(Picture{});
  picture->pixels = std::move(image);
  picture->depth_unit = unit;
  return picture;
}

absl::StatusOr<Picture> RenderSegments(const Segmenter& segmenter, const Question& question) {
  Grey16Image image = {question.view.camera.width, question.view.camera.height, {}};
  const auto render = [&](const Decomposition& whole) -> absl::Status {
    ASSIGN_OR_RETURN(
        const std::vector<int32_t> ids,
        segmenter.RenderIds(question.view, whole.levels[question.level].ids, question.shown()));
    image.pixels.assign(ids.begin(), ids.end());
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(segmenter.WithDecomposition(question.scales, render));
  return Picture{std::move(image)};
}

absl::StatusOr<Picture> RenderFeatures(const Segmenter& segmenter, const Question& question) {
  ASSIGN_OR_RETURN(Image image, segmenter.RenderFeatures(question.view, question.feature_scale,
                                                         question.shown()));
  return Picture{std::move(image)};
}

absl::StatusOr<Picture> Render(const Segmenter& segmenter, const Question& question,
                               v1::RenderRequest::Content content) {
  switch (content) {
    case v1::RenderRequest::CONTENT_DEPTH:
      return RenderDepth(segmenter, question);
    case v1::RenderRequest::CONTENT_SEGMENTS:
      return RenderSegments(segmenter, question);
    case v1::RenderRequest::CONTENT_FEATURES:
      return RenderFeatures(segmenter, question);
    default:
      return RenderColor(segmenter, question);
  }
}

}  // namespace

absl::Status AnswerRender(const UnaryCall& call, const ServiceContext& context,
                          const v1::RenderRequest& request, v1::RenderResponse* response) {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model, LoadModel(context, request.model(), "model"));
  if (request.content() == v1::RenderRequest::CONTENT_SEGMENTS ||
      request.content() == v1::RenderRequest::CONTENT_FEATURES) {
    RETURN_IF_ERROR(CheckFeatures(model));
  }
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  ASSIGN_OR_RETURN(const Question question, ReadQuestion(context, model, request));
  RETURN_IF_ERROR(call.CheckWanted());
  ASSIGN_OR_RETURN(const Picture picture, Render(*model.segmenter, question, request.content()));
  *timing.mutable_compute() = ToProto(stopwatch.Lap());
  ASSIGN_OR_RETURN(
      *response->mutable_png(),
      std::visit([](const auto& pixels) { return EncodePng(pixels); }, picture.pixels));
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  response->set_width(question.view.camera.width);
  response->set_height(question.view.camera.height);
  response->set_depth_unit(picture.depth_unit);
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
