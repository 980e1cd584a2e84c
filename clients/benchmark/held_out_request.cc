#include "clients/benchmark/held_out_request.h"

#include "absl/strings/str_cat.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/picture.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

// Reads a label image of 8 bits, or one of 16 bits whose ids fit into 8. INVALID_ARGUMENT: they do
// not.
absl::StatusOr<GreyPicture> ReadLabels(const fs::path& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const auto wide = DecodeGrey16(bytes, path.string());
  if (!wide.ok()) return ReadGreyPicture(path);
  GreyPicture labels{wide->width, wide->height, {}};
  labels.pixels.reserve(wide->pixels.size());
  for (const uint16_t id : wide->pixels) {
    if (id > 255) {
      return absl::InvalidArgumentError(
          absl::StrCat(path.string(), ": the id ", id,
                       " exceeds 255, the limit of `pepeseg-benchmark curves`; use "
                       "`pepeseg-benchmark evaluate`"));
    }
    labels.pixels.push_back(static_cast<uint8_t>(id));
  }
  return labels;
}

// Returns a label image as a PNG of FittingSize.
absl::StatusOr<std::string> LabelsPng(const fs::path& path, const PixelSize& photograph) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const auto wide = DecodeGrey16(bytes, path.string());
  if (wide.ok() && PixelSize{wide->width, wide->height} == photograph) return bytes;
  ASSIGN_OR_RETURN(const GreyPicture labels, ReadLabels(path));
  ASSIGN_OR_RETURN(const PixelSize size,
                   FittingSize(path, {labels.width, labels.height}, photograph));
  return EncodePng(Resized(labels, size.width, size.height));
}

}  // namespace

absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const fs::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views) {
  v1::EvaluateModelRequest request;
  request.set_model(model);
  request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
  for (const auto& [id, name] : level.entities) (*request.mutable_entity_names())[id] = name;
  const fs::path ignore = dataset / "ignore_mask.png";
  for (const v1::View& view : views) {
    const fs::path path = level.folder / fs::path(view.view()).replace_extension(".png");
    const OutlinedPhotograph* outlines = OutlinesOf(level.outlines, view.view());
    if (!view.held_out() || (outlines == nullptr && !PathExists(path))) continue;
    v1::ViewTruth& truth = *request.add_views();
    truth.set_view(view.view());
    if (outlines != nullptr) {
      RETURN_IF_ERROR(AddOutlines(*outlines, PhotographSize(view), truth));
    } else {
      ASSIGN_OR_RETURN(*truth.mutable_labels_png(), LabelsPng(path, PhotographSize(view)));
    }
    if (!PathExists(ignore)) continue;
    ASSIGN_OR_RETURN(*truth.mutable_ignore_png(), LabelsPng(ignore, PhotographSize(view)));
  }
  return request;
}

}  // namespace pepeseg::client::cli
