#include "server/services/render_answer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
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
#include "core/query/prompt.h"
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

// A request in the model's terms. Which fields are used depends on the content that is asked for.
struct RenderQuery {
  ModelView view;
  ImageOfView image = ImageOf({}, v1::PIXEL_FRAME_VIEW);  // the image to answer, at its full size
  int max_side = 0;                                       // pixels; 0: not given
  std::optional<GaussianSet> subset;
  std::optional<BinaryMask> overlay;
  ImageSize overlay_size;
  std::optional<std::vector<int32_t>>
      overlay_members;  // for each Gaussian 1 in the overlay, else 0
  std::vector<double> scales;
  int level = 0;
  double feature_scale = 0;

  const GaussianSet* shown() const { return subset ? &*subset : nullptr; }
};

// What is rendered, and how it becomes the answer.
struct Canvas {
  int width = 0, height = 0;         // size of the answer, pixels
  ModelView view;                    // the view to render
  std::optional<ViewPlaces> places;  // where the answer's pixels are in it; none: the same pixels
};

// An image to encode. `depth_unit`: what a step of a depth image is in units of the scene; 0 for
// the other contents.
struct Picture {
  std::variant<Image, Grey16Image> pixels;
  double depth_unit = 0;
};

int Shrunk(int side, double share) {
  return std::max(1, static_cast<int>(std::lround(side * share)));
}

// Returns the same view at another size in pixels.
ModelView AtSize(const ModelView& view, int width, int height) {
  ModelView resized = view;
  const double sx = static_cast<double>(width) / view.camera.width;
  const double sy = static_cast<double>(height) / view.camera.height;
  Camera& camera = resized.camera;
  camera = {width, height, camera.fx * sx, camera.fy * sy, camera.cx * sx, camera.cy * sy};
  return resized;
}

// Returns the size of the answer that is asked for, as a share of the full size in (0, 1].
double ShareAskedFor(const RenderQuery& query) {
  const PhotographFrame& frame = query.image.frame;
  if (query.max_side > 0) {
    return std::min(1.0,
                    static_cast<double>(query.max_side) / std::max(frame.width(), frame.height()));
  }
  if (query.view.name.empty()) return 1;  // a free camera has the size that it says
  const double num_pixels = static_cast<double>(frame.width()) * frame.height();
  return std::min(1.0, std::sqrt(static_cast<double>(kDefaultPixels) / num_pixels));
}

// Returns a pinhole view at the answer's resolution, to be warped by the lens if there is one.
// Features are not rendered larger than they were trained, so that they look as clicks see them.
Canvas MakeCanvas(const RenderQuery& query, double share, v1::RenderViewRequest::Content content) {
  const PhotographFrame& frame = query.image.frame;
  Canvas canvas{Shrunk(frame.width(), share), Shrunk(frame.height(), share), query.view, {}};
  const Camera& camera = query.view.camera;
  if (frame.is_view() && canvas.width == camera.width && canvas.height == camera.height) {
    return canvas;
  }
  const bool enlarged = canvas.width > camera.width || canvas.height > camera.height;
  const bool as_trained = content == v1::RenderViewRequest::CONTENT_FEATURES && enlarged;
  if (frame.is_shrunk() && !as_trained) {
    canvas.view = AtSize(query.view, canvas.width, canvas.height);
    return canvas;
  }
  if (!as_trained) {
    const Photograph& photograph = *query.view.photograph;
    canvas.view =
        AtSize(query.view, Shrunk(photograph.width, share), Shrunk(photograph.height, share));
  }
  canvas.places.emplace(PhotographFrame(canvas.view), canvas.width, canvas.height);
  return canvas;
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

// Returns for each Gaussian 1 if it is in the overlay's subset, else 0.
absl::StatusOr<std::vector<int32_t>> ReadMembers(const NamedScenes& scenes,
                                                 const Selections& selections,
                                                 const ResidentModel& model,
                                                 const v1::Subset& subset) {
  ASSIGN_OR_RETURN(const std::optional<GaussianSet> members,
                   selections.FindSubset(scenes, model, subset, "overlay_subset"));
  // Here "all of the model" would tint the whole picture, so it is refused.
  if (!members) return BadField("overlay_subset", "", "neither a selection nor a segment");
  return std::vector<int32_t>(members->member.begin(), members->member.end());
}

// Reads the overlay mask, which has the size of the frame or of the answer.
absl::Status ReadOverlay(const v1::MaskImage& mask, RenderQuery& query) {
  const Canvas canvas =
      MakeCanvas(query, ShareAskedFor(query), v1::RenderViewRequest::CONTENT_COLOR);
  query.overlay_size = SizeOf(mask);
  // A client may draw on the picture that it got, which has the answer's size, or on the photograph
  // itself.
  ImageOfView expected = query.image;
  if (query.overlay_size == ImageSize{canvas.width, canvas.height}) {
    ModelView answer = query.view;
    answer.photograph.reset();
    expected.frame = PhotographFrame(AtSize(answer, canvas.width, canvas.height));
  }
  ASSIGN_OR_RETURN(query.overlay, ReadMask(mask, expected, "overlay_mask"));
  return absl::OkStatus();
}

absl::StatusOr<RenderQuery> ReadQuery(const NamedScenes& scenes, const Selections& selections,
                                      const ResidentModel& model,
                                      const v1::RenderViewRequest& request) {
  RETURN_IF_ERROR(CheckRequest(request));
  RenderQuery query;
  ASSIGN_OR_RETURN(query.view,
                   FindViewpoint(request.viewpoint(), model.segmenter->model(), "viewpoint"));
  query.image = ImageOf(query.view, request.frame());
  query.max_side = request.max_side();
  if (request.content() == v1::RenderViewRequest::CONTENT_SEGMENTS) {
    ASSIGN_OR_RETURN(query.scales,
                     ReadScales(request.decomposition_scales(), "decomposition_scales"));
    RETURN_IF_ERROR(CheckLevelField(request.level(), query.scales.size(), "level"));
    query.level = request.level();
  }
  query.feature_scale = request.feature_scale();
  if (request.content() == v1::RenderViewRequest::CONTENT_FEATURES &&
      !(query.feature_scale >= 0 && query.feature_scale <= 1)) {
    return BadField("feature_scale", absl::StrCat(query.feature_scale), "not in [0, 1]");
  }
  ASSIGN_OR_RETURN(query.subset, selections.FindSubset(scenes, model, request.subset(), "subset"));
  if (request.has_overlay_mask()) {
    RETURN_IF_ERROR(ReadOverlay(request.overlay_mask(), query));
  } else if (request.has_overlay_subset()) {
    ASSIGN_OR_RETURN(query.overlay_members,
                     ReadMembers(scenes, selections, model, request.overlay_subset()));
  }
  return query;
}

constexpr uint8_t kOverlayColor[3] = {255, 120, 0};
constexpr double kOverlayTint = 0.45;

bool IsBorder(const BinaryMask& mask, const Image& image, int x, int y) {
  const auto is_out = [&](int at_x, int at_y) {
    return at_x < 0 || at_x >= image.width || at_y < 0 || at_y >= image.height ||
           mask.pixels[static_cast<size_t>(at_y) * image.width + at_x] == 0;
  };
  return is_out(x - 1, y) || is_out(x + 1, y) || is_out(x, y - 1) || is_out(x, y + 1);
}

// Tints an RGB image where the mask, which has the size of the image, is set, and draws its border.
void DrawOverlay(const BinaryMask& mask, Image& image) {
  assert(image.channels == 3 && mask.pixels.size() * 3 == image.pixels.size());
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * image.width + x;
      if (mask.pixels[pixel] == 0) continue;
      // A pixel at the edge of the image counts as border too.
      const double share = IsBorder(mask, image, x, y) ? 1 : kOverlayTint;
      for (int k = 0; k < 3; ++k) {
        uint8_t& value = image.pixels[3 * pixel + k];
        value = static_cast<uint8_t>(std::lround((1 - share) * value + share * kOverlayColor[k]));
      }
    }
  }
}

Image Warped(Image image, const Canvas& canvas) {
  return canvas.places ? ColorsInPhotograph(image, *canvas.places) : image;
}

template <class T>
std::vector<T> Warped(std::vector<T> values, const Canvas& canvas) {
  return canvas.places ? NearestInPhotograph(std::span<const T>(values), *canvas.places) : values;
}

// Returns the overlay of the request at the size of the answer, or nullopt if there is none. The
// overlay of a subset covers the pixels to which the subset contributes most.
absl::StatusOr<std::optional<BinaryMask>> FindOverlay(const Segmenter& segmenter,
                                                      const RenderQuery& query,
                                                      const Canvas& canvas) {
  if (query.overlay) {
    return Resized(*query.overlay, query.overlay_size, {canvas.width, canvas.height});
  }
  if (!query.overlay_members) return std::nullopt;
  ASSIGN_OR_RETURN(const std::vector<int32_t> ids,
                   segmenter.RenderIds(canvas.view, *query.overlay_members, query.shown()));
  const std::vector<int32_t> image = Warped(ids, canvas);
  return BinaryMask{{image.begin(), image.end()}};
}

absl::StatusOr<Picture> RenderColor(const Segmenter& segmenter, const RenderQuery& query,
                                    const Canvas& canvas) {
  ASSIGN_OR_RETURN(Image rendered, segmenter.RenderColor(canvas.view, query.shown()));
  Image image = Warped(std::move(rendered), canvas);
  ASSIGN_OR_RETURN(const std::optional<BinaryMask> overlay, FindOverlay(segmenter, query, canvas));
  if (overlay) DrawOverlay(*overlay, image);
  return Picture{std::move(image)};
}

// Renders depth in units that make the deepest pixel 65535.
absl::StatusOr<Picture> RenderDepth(const Segmenter& segmenter, const RenderQuery& query,
                                    const Canvas& canvas) {
  ASSIGN_OR_RETURN(std::vector<float> rendered, segmenter.RenderDepth(canvas.view, query.shown()));
  const std::vector<float> depth = Warped(std::move(rendered), canvas);
  const double deepest = depth.empty() ? 0 : *std::max_element(depth.begin(), depth.end());
  // An image without depth gets a unit over 0, since clients divide by it.
  const double unit = (deepest > 0 ? deepest : 1) / kDeepest;
  Grey16Image image = {canvas.width, canvas.height, {}};
  image.pixels.reserve(depth.size());
  for (const float value : depth) {
    // 0 means that nothing is there, so the smallest depth becomes 1.
    const double steps = std::clamp(double{value} / unit, value > 0 ? 1.0 : 0.0, kDeepest);
    image.pixels.push_back(static_cast<uint16_t>(std::lround(steps)));
  }
  absl::StatusOr<Picture> picture(Picture{});
  picture->pixels = std::move(image);
  picture->depth_unit = unit;
  return picture;
}

absl::StatusOr<Picture> RenderSegments(const Segmenter& segmenter, const RenderQuery& query,
                                       const Canvas& canvas) {
  Grey16Image image = {canvas.width, canvas.height, {}};
  const auto render = [&](const Decomposition& whole) -> absl::Status {
    ASSIGN_OR_RETURN(
        std::vector<int32_t> rendered,
        segmenter.RenderIds(canvas.view, whole.levels[query.level].ids, query.shown()));
    const std::vector<int32_t> ids = Warped(std::move(rendered), canvas);
    // The ids are copied, since the decomposition may be dropped when the callback returns.
    image.pixels.assign(ids.begin(), ids.end());
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(segmenter.WithDecomposition(query.scales, render));
  return Picture{std::move(image)};
}

absl::StatusOr<Picture> RenderFeatures(const Segmenter& segmenter, const RenderQuery& query,
                                       const Canvas& canvas) {
  ASSIGN_OR_RETURN(Image image,
                   segmenter.RenderFeatures(canvas.view, query.feature_scale, query.shown()));
  return Picture{Warped(std::move(image), canvas)};
}

absl::StatusOr<Picture> RenderContent(const Segmenter& segmenter, const RenderQuery& query,
                                      const Canvas& canvas,
                                      v1::RenderViewRequest::Content content) {
  switch (content) {
    case v1::RenderViewRequest::CONTENT_DEPTH:
      return RenderDepth(segmenter, query, canvas);
    case v1::RenderViewRequest::CONTENT_SEGMENTS:
      return RenderSegments(segmenter, query, canvas);
    case v1::RenderViewRequest::CONTENT_FEATURES:
      return RenderFeatures(segmenter, query, canvas);
    default:
      return RenderColor(segmenter, query, canvas);
  }
}

// Renders the answer into `response`, with the times of computing and encoding. If the request does
// not say a size, renders it smaller until it fits into a message.
absl::Status RenderToFit(const UnaryCall& call, const Segmenter& segmenter,
                         const RenderQuery& query, v1::RenderViewRequest::Content content,
                         v1::RenderViewResponse* response) {
  constexpr size_t kRest = 1024;  // bytes of the answer that are not the image
  // A smaller image has more detail in each pixel, so it shrinks less than its number of pixels.
  constexpr double kSpare = 0.8;
  Stopwatch stopwatch;
  absl::Duration compute, encode;
  double share = ShareAskedFor(query);
  for (;;) {
    // Before each render: every size that did not fit has cost one.
    RETURN_IF_ERROR(call.CheckWanted());
    const Canvas canvas = MakeCanvas(query, share, content);
    ASSIGN_OR_RETURN(const Picture picture, RenderContent(segmenter, query, canvas, content));
    compute += stopwatch.Lap();
    ASSIGN_OR_RETURN(
        *response->mutable_png(),
        std::visit([](const auto& pixels) { return EncodePng(pixels); }, picture.pixels));
    encode += stopwatch.Lap();
    response->set_width(canvas.width);
    response->set_height(canvas.height);
    response->set_depth_unit(picture.depth_unit);
    // A size that the client gave is kept, and CheckAnswerSize then refuses an image that is too
    // large.
    const bool may_shrink = query.max_side == 0 && !query.view.name.empty();
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
  ASSIGN_OR_RETURN(const RenderQuery query, ReadQuery(call.scenes(), selections_, model, request));
  RETURN_IF_ERROR(RenderToFit(call, *model.segmenter, query, request.content(), response));
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
