#include "server/services/kept_embedding.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
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

}  // namespace

absl::StatusOr<SamEmbedding> ReadKeptEmbedding(const std::filesystem::path& model,
                                               const ModelView& view,
                                               const EmbeddingOrigin& origin) {
  const std::filesystem::path file = model / EmbeddingFileName(view.name);
  ASSIGN_OR_RETURN(SamEmbedding embedding, ReadEmbedding(file, origin));
  if (IsOfShape(embedding, Frame(view))) return embedding;
  return absl::DataLossError(absl::StrCat(file.string(), ": is of a photograph of another shape"));
}

absl::StatusOr<BinaryMask> RefineInPhotograph(const SamBorders& sam, const SamEmbedding& embedding,
                                              const ModelView& view, const BinaryMask& mask) {
  Frame frame(view);
  const int width = embedding.width, height = embedding.height;
  if (frame.is_shrunk() && width == view.camera.width && height == view.camera.height) {
    return sam.Refine(embedding, mask);
  }
  frame.ResizeTo(width, height);
  const BinaryMask before = frame.FromView(mask);
  ASSIGN_OR_RETURN(const BinaryMask after, sam.Refine(embedding, before));
  BinaryMask refined = mask;
  const std::vector<int32_t> pixels = frame.PixelsOfView();
  for (size_t i = 0; i < pixels.size(); ++i) {
    const int64_t x = pixels[i] % frame.width(), y = pixels[i] / frame.width();
    const auto pixel = static_cast<size_t>((2 * y + 1) * height / (2 * frame.height()) * width +
                                           (2 * x + 1) * width / (2 * frame.width()));
    if (after.pixels[pixel] != before.pixels[pixel]) refined.pixels[i] = after.pixels[pixel];
  }
  return refined;
}

}  // namespace pepeseg
