#include "core/evaluate/truth_view.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr double kKeepDuplicates = 1;  // no IoU exceeds it: entities may have equal masks

}  // namespace

std::optional<int> TruthView::IndexOf(absl::string_view entity) const {
  const auto found = std::find(entities.begin(), entities.end(), entity);
  if (found == entities.end()) return std::nullopt;
  return static_cast<int>(found - entities.begin());
}

std::vector<uint8_t> TruthView::MaskOf(absl::string_view entity) const {
  const std::optional<int> index = IndexOf(entity);
  return index ? masks.Extract(*index).pixels : std::vector<uint8_t>();
}

std::vector<uint8_t> TruthView::CountedMaskOf(absl::string_view entity) const {
  std::vector<uint8_t> mask = MaskOf(entity);
  if (ignore.empty()) return mask;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (ignore[i] != 0) mask[i] = 0;
  }
  return mask;
}

TruthViewBuilder::TruthViewBuilder(ModelView view)
    : truth_{std::move(view), {}, {}, {}, 0},
      masks_(truth_.view.camera.width, truth_.view.camera.height, kKeepDuplicates) {}

absl::Status TruthViewBuilder::CheckSize(absl::string_view what, size_t num_pixels) const {
  const Camera& camera = truth_.view.camera;
  if (num_pixels == static_cast<size_t>(camera.width) * camera.height) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("view \"", truth_.view.name, "\": ", what, " has ",
                                                 num_pixels, " pixels, must have ", camera.width,
                                                 "x", camera.height));
}

absl::Status TruthViewBuilder::AddMask(const std::string& entity, std::span<const uint8_t> mask) {
  RETURN_IF_ERROR(CheckSize(absl::StrCat("the mask of entity \"", entity, "\""), mask.size()));
  std::vector<uint32_t> pixels;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
  }
  return Add(entity, pixels);
}

std::optional<int> VoidLabelOf(std::span<const uint16_t> labels) {
  constexpr int kHalf = (kWideVoidLabel + 1) / 2;
  int largest = 0, second = 0;
  for (const int label : labels) {
    if (label > largest) {
      second = largest;
      largest = label;
    } else if (label > second && label < largest) {
      second = label;
    }
  }
  if (second == 0) return std::nullopt;
  if (largest == kVoidLabel || (largest == kWideVoidLabel && second < kHalf)) return largest;
  return std::nullopt;
}

absl::Status TruthViewBuilder::AddLabels(std::span<const uint16_t> labels,
                                         const std::map<int, std::string>& names,
                                         std::optional<int> void_label) {
  RETURN_IF_ERROR(CheckSize("the label image", labels.size()));
  std::map<int, std::vector<uint32_t>> pixels;
  for (size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] != 0) pixels[labels[i]].push_back(static_cast<uint32_t>(i));
  }
  if (void_label && pixels.contains(*void_label)) {
    std::vector<uint8_t> ignore(labels.size());
    for (const uint32_t pixel : pixels[*void_label]) ignore[pixel] = 1;
    RETURN_IF_ERROR(AddIgnore(ignore));
    truth_.num_void += static_cast<int64_t>(pixels[*void_label].size());
    pixels.erase(*void_label);
  }
  for (const auto& [id, of_id] : pixels) {
    const auto name = names.find(id);
    RETURN_IF_ERROR(Add(name == names.end() ? absl::StrCat(id) : name->second, of_id));
  }
  return absl::OkStatus();
}

absl::Status TruthViewBuilder::AddIgnore(std::span<const uint8_t> ignore) {
  RETURN_IF_ERROR(CheckSize("the ignore mask", ignore.size()));
  truth_.ignore.resize(ignore.size());
  for (size_t i = 0; i < ignore.size(); ++i) truth_.ignore[i] |= ignore[i];
  return absl::OkStatus();
}

absl::Status TruthViewBuilder::Add(const std::string& entity, std::span<const uint32_t> pixels) {
  if (entity.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("view \"", truth_.view.name, "\": an entity has no name"));
  }
  if (truth_.IndexOf(entity)) {
    return absl::InvalidArgumentError(absl::StrCat("view \"", truth_.view.name, "\": entity \"",
                                                   entity, "\" has a mask already"));
  }
  if (masks_.Add(pixels)) truth_.entities.push_back(entity);
  return absl::OkStatus();
}

TruthView TruthViewBuilder::Build() && {
  truth_.masks = std::move(masks_).Build();
  return std::move(truth_);
}

std::string CategoryOf(absl::string_view entity) {
  const size_t last = entity.find_last_not_of("0123456789");
  const bool numbered = last != absl::string_view::npos && last + 1 < entity.size() &&
                        absl::string_view(". _-").find(entity[last]) != absl::string_view::npos;
  if (!numbered) return std::string(entity);
  const size_t end = entity.find_last_not_of(". _-", last);
  if (end == absl::string_view::npos) return std::string(entity);
  return std::string(entity.substr(0, end + 1));
}

}  // namespace pepeseg
