#include "core/evaluate/labeled_view.h"

#include <algorithm>
#include <limits>
#include <map>

#include "absl/strings/str_cat.h"

namespace pepeseg {

std::vector<uint8_t> LabeledView::MaskOf(uint16_t entity) const {
  std::vector<uint8_t> mask(labels.size());
  for (size_t i = 0; i < mask.size(); ++i) mask[i] = labels[i] == entity && Counts(i) ? 1 : 0;
  return mask;
}

absl::Status CheckLabeledViews(std::span<const LabeledView> views) {
  std::vector<std::string> names;
  for (const LabeledView& labeled : views) {
    const Camera& camera = labeled.view.camera;
    const size_t num_pixels = static_cast<size_t>(camera.width) * camera.height;
    if (labeled.labels.size() != num_pixels ||
        (!labeled.ignore.empty() && labeled.ignore.size() != num_pixels)) {
      return absl::InvalidArgumentError(
          absl::StrCat("view ", labeled.view.name, ": ", labeled.labels.size(), " labels and ",
                       labeled.ignore.size(), " ignore values; it has ", num_pixels, " pixels"));
    }
    names.push_back(labeled.view.name);
  }
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice == names.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("view ", *twice, " has labels twice"));
}

std::vector<ShownEntity> FindEntities(std::span<const LabeledView> views, int64_t min_pixels) {
  std::vector<const LabeledView*> by_name;
  for (const LabeledView& view : views) by_name.push_back(&view);
  std::sort(by_name.begin(), by_name.end(),
            [](const LabeledView* a, const LabeledView* b) { return a->view.name < b->view.name; });
  std::map<uint16_t, ShownEntity> entities;
  for (const LabeledView* view : by_name) {
    std::vector<int64_t> num_pixels(std::numeric_limits<uint16_t>::max() + size_t{1});
    for (size_t i = 0; i < view->labels.size(); ++i) {
      if (view->Counts(i)) ++num_pixels[view->labels[i]];
    }
    for (size_t id = 1; id < num_pixels.size(); ++id) {
      if (num_pixels[id] == 0) continue;
      ShownEntity& entity = entities[static_cast<uint16_t>(id)];
      entity.id = static_cast<uint16_t>(id);
      if (num_pixels[id] < min_pixels) continue;
      entity.views.push_back(view);
      entity.num_pixels.push_back(num_pixels[id]);
    }
  }
  std::vector<ShownEntity> all;
  all.reserve(entities.size());
  for (auto& [id, entity] : entities) all.push_back(std::move(entity));
  return all;
}

}  // namespace pepeseg
