#include "core/query/render_view.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <span>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr uint8_t kOverlayColor[3] = {255, 120, 0};
constexpr double kOverlayTint = 0.45;

int ShrunkSide(int side, double share) {
  return std::max(1, static_cast<int>(std::lround(side * share)));
}

// The rendered view, and its frame in the image.
struct Canvas {
  ModelView view;              // the view to render
  std::optional<Frame> frame;  // maps it to the image; none: the same pixels
};

Canvas MakeCanvas(const RenderRequest& request, const ImageSize& size) {
  const Frame frame(request.view, request.frame);
  Canvas canvas{request.view, {}};
  const Camera& camera = request.view.camera;
  const auto width = static_cast<int>(size.width), height = static_cast<int>(size.height);
  if (frame.is_view() && width == camera.width && height == camera.height) return canvas;
  const bool enlarged = width > camera.width || height > camera.height;
  const bool as_trained = request.content == RenderContent::kFeatures && enlarged;
  if (frame.is_shrunk() && !as_trained) {
    canvas.view = AtSize(request.view, width, height);
    return canvas;
  }
  if (!as_trained) {
    const Photograph& photograph = *request.view.photograph;
    canvas.view = AtSize(request.view, ShrunkSide(photograph.width, request.share),
                         ShrunkSide(photograph.height, request.share));
  }
  canvas.frame.emplace(canvas.view);
  canvas.frame->ResizeTo(width, height);
  return canvas;
}

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
  return canvas.frame ? canvas.frame->FromView(image) : image;
}

template <class T>
std::vector<T> Warped(std::vector<T> values, const Canvas& canvas) {
  return canvas.frame ? canvas.frame->NearestFromView(std::span<const T>(values)) : values;
}

// Renders the contents of a request.
class ContentRenderer {
 public:
  ContentRenderer(const Segmenter& segmenter, const RenderRequest& request)
      : segmenter_(segmenter),
        request_(request),
        shown_(request.subset ? &*request.subset : nullptr),
        size_(request.Size()),
        canvas_(MakeCanvas(request, size_)) {}

  absl::StatusOr<RenderedView> Render() const {
    RenderedView rendered;
    rendered.size = size_;
    switch (request_.content) {
      case RenderContent::kColor: {
        ASSIGN_OR_RETURN(rendered.color, Color());
        break;
      }
      case RenderContent::kDepth: {
        ASSIGN_OR_RETURN(std::vector<float> depth, segmenter_.RenderDepth(canvas_.view, shown_));
        rendered.depth = Warped(std::move(depth), canvas_);
        break;
      }
      case RenderContent::kSegments: {
        RETURN_IF_ERROR(segmenter_.WithDecomposition(
            request_.scales, [&](const Decomposition& whole) -> absl::Status {
              ASSIGN_OR_RETURN(rendered.ids, Ids(whole.levels[request_.level].ids));
              return absl::OkStatus();
            }));
        break;
      }
      case RenderContent::kFeatures: {
        ASSIGN_OR_RETURN(Image image,
                         segmenter_.RenderFeatures(canvas_.view, request_.feature_scale, shown_));
        rendered.color = Warped(std::move(image), canvas_);
        break;
      }
    }
    return rendered;
  }

 private:
  absl::StatusOr<std::vector<int32_t>> Ids(std::span<const int32_t> ids) const {
    ASSIGN_OR_RETURN(std::vector<int32_t> rendered,
                     segmenter_.RenderIds(canvas_.view, ids, shown_));
    return Warped(std::move(rendered), canvas_);
  }
  absl::StatusOr<Image> Color() const {
    ASSIGN_OR_RETURN(Image rendered, segmenter_.RenderColor(canvas_.view, shown_));
    Image image = Warped(std::move(rendered), canvas_);
    if (request_.overlay) {
      DrawOverlay(Resized(*request_.overlay, request_.overlay_size, size_), image);
    } else if (request_.overlay_set) {
      const std::vector<uint8_t>& member = request_.overlay_set->member;
      ASSIGN_OR_RETURN(const std::vector<int32_t> ids,
                       Ids(std::vector<int32_t>(member.begin(), member.end())));
      DrawOverlay({{ids.begin(), ids.end()}}, image);
    }
    return image;
  }

  const Segmenter& segmenter_;
  const RenderRequest& request_;
  const GaussianSet* const shown_;
  const ImageSize size_;
  const Canvas canvas_;
};

}  // namespace

ImageSize RenderRequest::Size() const {
  const Frame full(view, frame);
  return {ShrunkSide(full.width(), share), ShrunkSide(full.height(), share)};
}

absl::StatusOr<RenderedView> RenderFrame(const Segmenter& segmenter, const RenderRequest& request) {
  return ContentRenderer(segmenter, request).Render();
}

}  // namespace pepeseg
