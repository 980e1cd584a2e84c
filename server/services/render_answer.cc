#include "server/services/render_answer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/encode_png.h"
#include "core/query/photograph_images.h"
#include "core/query/view_places.h"
#include "server/api/error.h"
#include "server/api/pixel_frame.h"
#include "server/api/read_mask.h"
#include "server/api/rows_to_proto.h"
#include "server/services/answer_size.h"
#include "server/services/model_lookup.h"
#include "server/services/overlay.h"
#include "server/services/read_prompt.h"
#include "server/services/segment_lookup.h"
#include "server/services/stopwatch.h"
#include "server/services/subset_lookup.h"

namespace pepeseg {
namespace {

constexpr double kDeepest = 65'535;  // of 16 bits
constexpr int kMaxSide = 16'384;
// Of an answer whose request says nothing of its size: what a renderer keeps memory for.
constexpr int64_t kDefaultPixels = int64_t{1920} * 1080;

// A request in the model's terms; what of it is used depends on its content.
struct Question {
  ModelView view;
  ImageOfView image = ImageOf({}, v1::PIXEL_FRAME_VIEW);  // that is answered, at its full size
  int max_side = 0;
  std::optional<GaussianSet> subset;
  std::optional<BinaryMask> overlay;
  ImageSize overlay_size;
  std::optional<std::vector<int32_t>> overlay_members;  // a Gaussian each: 1 in the overlay
  std::vector<double> scales;
  int level = 0;
  double feature_scale = 0;

  const GaussianSet* shown() const { return subset ? &*subset : nullptr; }
};

// What is rendered for an answer, and how the answer is made of it.
struct Canvas {
  int width = 0, height = 0;         // of the answer
  ModelView view;                    // that is rendered
  std::optional<ViewPlaces> places;  // of the answer's pixels in it; none: the same pixels
};

struct Picture {
  std::variant<Image, Grey16Image> pixels;
  double depth_unit = 0;
};

int Shrunk(int side, double share) {
  return std::max(1, static_cast<int>(std::lround(side * share)));
}

// The same view at another size.
ModelView AtSize(const ModelView& view, int width, int height) {
  ModelView resized = view;
  const double sx = static_cast<double>(width) / view.camera.width;
  const double sy = static_cast<double>(height) / view.camera.height;
  Camera& camera = resized.camera;
  camera = {width, height, camera.fx * sx, camera.fy * sy, camera.cx * sx, camera.cy * sy};
  return resized;
}

// How much smaller than the full size the answer is asked for, (0, 1].
double ShareAskedFor(const Question& question) {
  const PhotographFrame& frame = question.image.frame;
  if (question.max_side > 0) {
    return std::min(
        1.0, static_cast<double>(question.max_side) / std::max(frame.width(), frame.height()));
  }
  if (question.view.name.empty()) return 1;  // a free camera has the size that it says
  const double num_pixels = static_cast<double>(frame.width()) * frame.height();
  return std::min(1.0, std::sqrt(static_cast<double>(kDefaultPixels) / num_pixels));
}

// A pinhole at the answer's resolution, warped by the lens where there is one. Features are not
// rendered larger than they were trained: clicks have their maps at that size.
Canvas MakeCanvas(const Question& question, double share, v1::RenderRequest::Content content) {
  const PhotographFrame& frame = question.image.frame;
  Canvas canvas{Shrunk(frame.width(), share), Shrunk(frame.height(), share), question.view, {}};
  const Camera& camera = question.view.camera;
  if (frame.is_view() && canvas.width == camera.width && canvas.height == camera.height) {
    return canvas;
  }
  const bool enlarged = canvas.width > camera.width || canvas.height > camera.height;
  const bool as_trained = content == v1::RenderRequest::CONTENT_FEATURES && enlarged;
  if (frame.is_shrunk() && !as_trained) {
    canvas.view = AtSize(question.view, canvas.width, canvas.height);
    return canvas;
  }
  if (!as_trained) {
    const Photograph& photograph = *question.view.photograph;
    canvas.view =
        AtSize(question.view, Shrunk(photograph.width, share), Shrunk(photograph.height, share));
  }
  canvas.places.emplace(PhotographFrame(canvas.view), canvas.width, canvas.height);
  return canvas;
}

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
  if (request.max_side() < 0 || request.max_side() > kMaxSide) {
    return BadField("max_side", absl::StrCat(request.max_side()),
                    absl::StrCat("not in [0, ", kMaxSide, "]"));
  }
  return CheckFrame(request.frame());
}

// The members of an overlay's subset.
absl::StatusOr<std::vector<int32_t>> ReadMembers(const ServiceContext& context,
                                                 const ResidentModel& model,
                                                 const v1::Subset& subset) {
  ASSIGN_OR_RETURN(const std::optional<GaussianSet> members,
                   FindSubset(context, model, subset, "overlay_subset"));
  if (!members) return BadField("overlay_subset", "", "neither a selection nor a segment");
  return std::vector<int32_t>(members->member.begin(), members->member.end());
}

// A mask of the size of the frame or of the answer.
absl::Status ReadOverlay(const v1::MaskImage& mask, Question& question) {
  const Canvas canvas =
      MakeCanvas(question, ShareAskedFor(question), v1::RenderRequest::CONTENT_COLOR);
  question.overlay_size = SizeOf(mask);
  ImageOfView expected = question.image;
  if (question.overlay_size == ImageSize{canvas.width, canvas.height}) {
    ModelView answer = question.view;
    answer.photograph.reset();
    expected.frame = PhotographFrame(AtSize(answer, canvas.width, canvas.height));
  }
  ASSIGN_OR_RETURN(question.overlay, ReadMask(mask, expected, "overlay_mask"));
  return absl::OkStatus();
}

absl::StatusOr<Question> ReadQuestion(const ServiceContext& context, const ResidentModel& model,
                                      const v1::RenderRequest& request) {
  RETURN_IF_ERROR(CheckRequest(request));
  Question question;
  ASSIGN_OR_RETURN(question.view,
                   FindViewpoint(request.viewpoint(), model.segmenter->model(), "viewpoint"));
  question.image = ImageOf(question.view, request.frame());
  question.max_side = request.max_side();
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
    RETURN_IF_ERROR(ReadOverlay(request.overlay_mask(), question));
  } else if (request.has_overlay_subset()) {
    ASSIGN_OR_RETURN(question.overlay_members,
                     ReadMembers(context, model, request.overlay_subset()));
  }
  return question;
}

Image Warped(Image image, const Canvas& canvas) {
  return canvas.places ? ColorsInPhotograph(image, *canvas.places) : image;
}

template <class T>
std::vector<T> Warped(std::vector<T> values, const Canvas& canvas) {
  return canvas.places ? NearestInPhotograph(std::span<const T>(values), *canvas.places) : values;
}

// Of a subset it is where most of what is shown belongs to it.
absl::StatusOr<std::optional<BinaryMask>> FindOverlay(const Segmenter& segmenter,
                                                      const Question& question,
                                                      const Canvas& canvas) {
  if (question.overlay) {
    return Resized(*question.overlay, question.overlay_size, {canvas.width, canvas.height});
  }
  if (!question.overlay_members) return std::nullopt;
  ASSIGN_OR_RETURN(const std::vector<int32_t> ids,
                   segmenter.RenderIds(canvas.view, *question.overlay_members, question.shown()));
  const std::vector<int32_t> image = Warped(ids, canvas);
  return BinaryMask{{image.begin(), image.end()}};
}

absl::StatusOr<Picture> RenderColor(const Segmenter& segmenter, const Question& question,
                                    const Canvas& canvas) {
  ASSIGN_OR_RETURN(Image rendered, segmenter.RenderColor(canvas.view, question.shown()));
  Image image = Warped(std::move(rendered), canvas);
  ASSIGN_OR_RETURN(const std::optional<BinaryMask> overlay,
                   FindOverlay(segmenter, question, canvas));
  if (overlay) DrawOverlay(*overlay, image);
  return Picture{std::move(image)};
}

// In steps that make the deepest pixel the largest number.
absl::StatusOr<Picture> RenderDepth(const Segmenter& segmenter, const Question& question,
                                    const Canvas& canvas) {
  ASSIGN_OR_RETURN(std::vector<float> rendered,
                   segmenter.RenderDepth(canvas.view, question.shown()));
  const std::vector<float> depth = Warped(std::move(rendered), canvas);
  const double deepest = depth.empty() ? 0 : *std::max_element(depth.begin(), depth.end());
  const double unit = (deepest > 0 ? deepest : 1) / kDeepest;
  Grey16Image image = {canvas.width, canvas.height, {}};
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

absl::StatusOr<Picture> RenderSegments(const Segmenter& segmenter, const Question& question,
                                       const Canvas& canvas) {
  Grey16Image image = {canvas.width, canvas.height, {}};
  const auto render = [&](const Decomposition& whole) -> absl::Status {
    ASSIGN_OR_RETURN(
        std::vector<int32_t> rendered,
        segmenter.RenderIds(canvas.view, whole.levels[question.level].ids, question.shown()));
    const std::vector<int32_t> ids = Warped(std::move(rendered), canvas);
    image.pixels.assign(ids.begin(), ids.end());
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(segmenter.WithDecomposition(question.scales, render));
  return Picture{std::move(image)};
}

absl::StatusOr<Picture> RenderFeatures(const Segmenter& segmenter, const Question& question,
                                       const Canvas& canvas) {
  ASSIGN_OR_RETURN(Image image,
                   segmenter.RenderFeatures(canvas.view, question.feature_scale, question.shown()));
  return Picture{Warped(std::move(image), canvas)};
}

absl::StatusOr<Picture> Render(const Segmenter& segmenter, const Question& question,
                               const Canvas& canvas, v1::RenderRequest::Content content) {
  switch (content) {
    case v1::RenderRequest::CONTENT_DEPTH:
      return RenderDepth(segmenter, question, canvas);
    case v1::RenderRequest::CONTENT_SEGMENTS:
      return RenderSegments(segmenter, question, canvas);
    case v1::RenderRequest::CONTENT_FEATURES:
      return RenderFeatures(segmenter, question, canvas);
    default:
      return RenderColor(segmenter, question, canvas);
  }
}

// Renders the answer, and where the request says nothing of its size, smaller until it fits into a
// message. What it took is added to `compute` and `encode`.
absl::Status RenderToFit(const UnaryCall& call, const Segmenter& segmenter,
                         const Question& question, v1::RenderRequest::Content content,
                         v1::RenderResponse* response) {
  constexpr size_t kRest = 1024;  // bytes of the answer that are not the image
  constexpr double kSpare = 0.8;  // smaller images have more detail in each of their pixels
  Stopwatch stopwatch;
  absl::Duration compute, encode;
  double share = ShareAskedFor(question);
  for (;;) {
    RETURN_IF_ERROR(call.CheckWanted());
    const Canvas canvas = MakeCanvas(question, share, content);
    ASSIGN_OR_RETURN(const Picture picture, Render(segmenter, question, canvas, content));
    compute += stopwatch.Lap();
    ASSIGN_OR_RETURN(
        *response->mutable_png(),
        std::visit([](const auto& pixels) { return EncodePng(pixels); }, picture.pixels));
    encode += stopwatch.Lap();
    response->set_width(canvas.width);
    response->set_height(canvas.height);
    response->set_depth_unit(picture.depth_unit);
    const bool may_shrink = question.max_side == 0 && !question.view.name.empty();
    if (!may_shrink || response->ByteSizeLong() + kRest <= kAnswerBytes) break;
    const auto excess =
        static_cast<double>(kAnswerBytes) / static_cast<double>(response->png().size());
    share *= std::sqrt(kSpare * excess);
  }
  *response->mutable_timing()->mutable_compute() = ToProto(compute);
  *response->mutable_timing()->mutable_encode() = ToProto(encode);
  return absl::OkStatus();
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
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  ASSIGN_OR_RETURN(const Question question, ReadQuestion(context, model, request));
  RETURN_IF_ERROR(RenderToFit(call, *model.segmenter, question, request.content(), response));
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
