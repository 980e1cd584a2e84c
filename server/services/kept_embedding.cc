#include "server/services/kept_embedding.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Returns whether an image of this size can be the frame's photograph, shrunk: each side is rounded
// to pixels by itself.
bool IsOfShape(const SamEmbedding& image, const Frame& frame) {
  const int64_t across = int64_t{image.width} * frame.height();
  const int64_t down = int64_t{image.height} * frame.width();
  return std::abs(across - down) <= std::max(frame.width(), frame.height());
}

// Returns whether SAM's image has the pixels of the view.
bool HasPixelsOfView(const PhotographSam& in, const Frame& frame) {
  const Camera& camera = in.view.camera;
  return !in.is_of_photograph || (frame.is_shrunk() && in.embedding.width == camera.width &&
                                  in.embedding.height == camera.height);
}

// Returns the pixel of the embedding's image for each pixel of the view.
std::vector<size_t> PixelsIn(const SamEmbedding& image, const Frame& frame) {
  std::vector<size_t> pixels;
  for (const int32_t pixel : frame.PixelsOfView()) {
    const int64_t x = pixel % frame.width(), y = pixel / frame.width();
    pixels.push_back(
        static_cast<size_t>((2 * y + 1) * image.height / (2 * frame.height()) * image.width +
                            (2 * x + 1) * image.width / (2 * frame.width())));
  }
  return pixels;
}

// Returns the place in SAM's image of a place in the view, both pixels.
PromptPoint PlaceIn(const PhotographSam& in, const Frame& frame, const Eigen::Vector2d& at) {
  if (HasPixelsOfView(in, frame)) {
    return {static_cast<float>(at.x()), static_cast<float>(at.y())};
  }
  const Eigen::Vector2d place = frame.FromView(at);
  return {static_cast<float>(place.x() * in.embedding.width / frame.width()),
          static_cast<float>(place.y() * in.embedding.height / frame.height())};
}

// Takes masks of SAM's image to the view.
void TakeToView(const PhotographSam& in, const Frame& frame, std::vector<SoftMask>& masks) {
  if (HasPixelsOfView(in, frame)) return;
  const std::vector<size_t> pixels = PixelsIn(in.embedding, frame);
  for (SoftMask& mask : masks) {
    BinaryMask in_view = {std::vector<uint8_t>(pixels.size())};
    for (size_t i = 0; i < pixels.size(); ++i) in_view.pixels[i] = mask.mask.pixels[pixels[i]];
    mask.mask = std::move(in_view);
  }
}

}  // namespace

absl::StatusOr<SamEmbedding> ReadKeptEmbedding(const std::filesystem::path& model,
                                               const ModelView& view,
                                               const EmbeddingOrigin& origin) {
  const std::filesystem::path file = model / EmbeddingFileName(view.name);
  ASSIGN_OR_RETURN(SamEmbedding embedding, ReadEmbedding(file, origin));
  if (IsOfShape(embedding, Frame(view))) return embedding;
  return absl::DataLossError(absl::StrCat(file.string(), ": is of a photograph of another shape"));
}

absl::StatusOr<BinaryMask> PhotographSam::Refine(const BinaryMask& mask,
                                                 const RefineLimits& limits) const {
  Frame frame(view);
  if (HasPixelsOfView(*this, frame)) return sam.Refine(embedding, mask, limits);
  frame.ResizeTo(embedding.width, embedding.height);
  const BinaryMask before = frame.FromView(mask);
  ASSIGN_OR_RETURN(const BinaryMask after, sam.Refine(embedding, before, limits));
  BinaryMask refined = mask;
  const std::vector<size_t> pixels = PixelsIn(embedding, frame);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t pixel = pixels[i];
    if (after.pixels[pixel] != before.pixels[pixel]) refined.pixels[i] = after.pixels[pixel];
  }
  return refined;
}

absl::StatusOr<std::vector<SoftMask>> PhotographSam::Click(std::span<const PointPrompt> clicks,
                                                           const SoftMask* before) const {
  const Frame frame(view);
  std::vector<PromptPoint> points;
  for (const PointPrompt& click : clicks) {
    PromptPoint& point = points.emplace_back(PlaceIn(*this, frame, {click.x, click.y}));
    point.positive = click.positive;
  }
  ASSIGN_OR_RETURN(std::vector<SoftMask> masks, sam.Click(embedding, points, before));
  TakeToView(*this, frame, masks);
  return masks;
}

absl::StatusOr<std::vector<SoftMask>> PhotographSam::Box(const BoxPrompt& box) const {
  const Frame frame(view);
  // SAM sees the smallest box around the corners in its image.
  std::array<PromptPoint, 2> corners = {PlaceIn(*this, frame, {box.x, box.y}), PromptPoint()};
  corners[1] = corners[0];
  for (const double x : {box.x, box.x + box.width}) {
    for (const double y : {box.y, box.y + box.height}) {
      const PromptPoint corner = PlaceIn(*this, frame, {x, y});
      corners[0] = {std::min(corners[0].x, corner.x), std::min(corners[0].y, corner.y)};
      corners[1] = {std::max(corners[1].x, corner.x), std::max(corners[1].y, corner.y)};
    }
  }
  ASSIGN_OR_RETURN(std::vector<SoftMask> masks, sam.Box(embedding, corners));
  TakeToView(*this, frame, masks);
  return masks;
}

std::vector<int32_t> PhotographSam::CellsOf(int width, int height) const {
  const Frame frame(view);
  const bool has_pixels_of_view = HasPixelsOfView(*this, frame);
  const double longer = std::max(embedding.width, embedding.height);
  const auto cell = [&](double share, int side) {
    return std::clamp(static_cast<int32_t>(share * side / longer * kSamCells), 0, kSamCells - 1);
  };
  std::vector<int32_t> cells;
  cells.reserve(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Eigen::Vector2d at((x + 0.5) / width, (y + 0.5) / height);  // share of the image
      if (!has_pixels_of_view) {
        const Eigen::Vector2d place = frame.FromView(
            Eigen::Vector2d(at.x() * view.camera.width, at.y() * view.camera.height));
        at = {place.x() / frame.width(), place.y() / frame.height()};
      }
      cells.push_back(cell(at.y(), embedding.height) * kSamCells + cell(at.x(), embedding.width));
    }
  }
  return cells;
}

}  // namespace pepeseg
