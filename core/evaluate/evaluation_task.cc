#include "core/evaluate/evaluation_task.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

// Returns the number of pixels of each of a view's masks that are not ignored.
std::vector<int64_t> CountedAreas(const TruthView& truth) {
  if (truth.ignore.empty()) return truth.masks.mask_area;
  std::vector<int64_t> areas;
  for (const std::string& name : truth.entities) {
    const std::vector<uint8_t> mask = truth.CountedMaskOf(name);
    areas.push_back(std::count(mask.begin(), mask.end(), uint8_t{1}));
  }
  return areas;
}

absl::Status CheckTruth(const TruthView& truth, bool accept_trained) {
  RETURN_IF_ERROR(CheckView(truth.view));
  const Camera& camera = truth.view.camera;
  const size_t num_pixels = static_cast<size_t>(camera.width) * camera.height;
  const bool sizes_fit = truth.entities.size() == static_cast<size_t>(truth.masks.num_masks) &&
                         (truth.entities.empty() || truth.masks.pixel_cell.size() == num_pixels) &&
                         (truth.ignore.empty() || truth.ignore.size() == num_pixels);
  if (!sizes_fit) {
    return absl::InvalidArgumentError(absl::StrCat(
        "view \"", truth.view.name, "\": ", truth.entities.size(), " names for ",
        truth.masks.num_masks, " masks of ", truth.masks.pixel_cell.size(), " pixels, ",
        truth.ignore.size(), " ignore values; the view has ", num_pixels, " pixels"));
  }
  return CheckHeldOut(truth.view, accept_trained);
}

// Checks a prompt against its view.
absl::Status CheckPrompt(const TruthView& truth, const ScoredEntity& entity) {
  if (const auto* shape = std::get_if<Shape>(&entity.prompt)) {
    return CheckShape(ImageOf(truth.view), *shape);
  }
  const std::vector<uint8_t> mask = truth.CountedMaskOf(entity.name);
  if (std::find(mask.begin(), mask.end(), uint8_t{1}) != mask.end()) return absl::OkStatus();
  return absl::InvalidArgumentError("the view has no mask of the entity to take the prompt from");
}

absl::Status SortViews(std::vector<TruthView>& views, bool accept_trained) {
  std::sort(views.begin(), views.end(),
            [](const TruthView& a, const TruthView& b) { return a.view.name < b.view.name; });
  for (size_t v = 0; v < views.size(); ++v) {
    RETURN_IF_ERROR(CheckTruth(views[v], accept_trained));
    if (v == 0 || views[v].view.name != views[v - 1].view.name) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("view \"", views[v].view.name, "\" comes twice"));
  }
  return absl::OkStatus();
}

// The views that show an entity, by index, with the number of counted pixels.
using Shown = std::map<size_t, int64_t>;

// Returns every entity of the views with the views that show it.
std::map<std::string, Shown> FindShown(const std::vector<TruthView>& views) {
  std::map<std::string, Shown> entities;
  for (size_t v = 0; v < views.size(); ++v) {
    const std::vector<int64_t> areas = CountedAreas(views[v]);
    for (size_t m = 0; m < areas.size(); ++m) entities[views[v].entities[m]][v] = areas[m];
  }
  return entities;
}

// Applies a prompt to its entity.
absl::Status TakePrompt(EvaluationTask& task, EntityPrompt prompt, std::set<std::string>& seen) {
  const auto entity =
      std::find_if(task.entities.begin(), task.entities.end(),
                   [&](const ScoredEntity& scored) { return scored.name == prompt.entity; });
  const auto view = std::find_if(task.views.begin(), task.views.end(), [&](const TruthView& truth) {
    return truth.view.name == prompt.view;
  });
  const std::string what =
      absl::StrCat("the prompt of entity \"", prompt.entity, "\" in view \"", prompt.view, "\": ");
  if (entity == task.entities.end()) {
    return absl::InvalidArgumentError(absl::StrCat(what, "no view has a mask of this entity"));
  }
  if (view == task.views.end()) {
    return absl::InvalidArgumentError(absl::StrCat(what, "the request has no such view"));
  }
  if (!seen.insert(prompt.entity).second) {
    return absl::InvalidArgumentError(absl::StrCat(what, "the entity has a prompt already"));
  }
  entity->reference = static_cast<size_t>(view - task.views.begin());
  entity->prompt = std::move(prompt.shape);
  absl::Status status = CheckPrompt(*view, *entity);
  if (status.ok()) return status;
  return absl::InvalidArgumentError(absl::StrCat(what, status.message()));
}

// Fills in the scored views of an entity whose reference is known.
void FindScored(ScoredEntity& entity, const Shown& shown, const TaskOptions& options) {
  for (const auto& [view, num_pixels] : shown) {
    if (num_pixels < options.min_pixels) continue;
    if (view == entity.reference && !options.score_reference) continue;
    entity.scored.push_back(view);
    entity.num_pixels.push_back(num_pixels);
  }
}

}  // namespace

absl::Status CheckHeldOut(const ModelView& view, bool accept_trained) {
  if (view.held_out || accept_trained) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("view \"", view.name,
                   "\" was trained on; score held-out views, or set accept_trained_views where the "
                   "protocol scores trained ones"));
}

absl::Status InReference(const EvaluationTask& task, const ScoredEntity& entity,
                         const absl::Status& status) {
  if (status.ok()) return status;
  return {status.code(),
          absl::StrCat("entity \"", entity.name, "\", reference view \"",
                       task.views[entity.reference].view.name, "\": ", status.message())};
}

absl::StatusOr<EvaluationTask> MakeTask(EvaluationRequest request, const TaskOptions& options) {
  if (options.min_pixels < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("min_pixels is ", options.min_pixels, ", must be at least 1"));
  }
  EvaluationTask task;
  task.views = std::move(request.views);
  RETURN_IF_ERROR(SortViews(task.views, request.accept_trained_views));
  const std::map<std::string, Shown> entities = FindShown(task.views);
  if (entities.size() > kMaxEntities) {
    return absl::InvalidArgumentError(absl::StrCat("the views have ", entities.size(),
                                                   " entities, must be at most ", kMaxEntities));
  }
  const size_t no_view = task.views.size();
  for (const auto& [name, shown] : entities) {
    const auto first = std::find_if(shown.begin(), shown.end(), [&](const auto& view_and_pixels) {
      return view_and_pixels.second >= options.min_pixels;
    });
    task.entities.push_back({name,
                             CategoryOf(name),
                             first == shown.end() ? no_view : first->first,
                             DeepestClick{},
                             {},
                             {}});
  }
  std::set<std::string> seen;
  for (EntityPrompt& prompt : request.prompts) {
    RETURN_IF_ERROR(TakePrompt(task, std::move(prompt), seen));
  }
  for (ScoredEntity& entity : task.entities) {
    if (entity.reference != no_view) FindScored(entity, entities.at(entity.name), options);
    if (entity.scored.empty()) task.left_out.push_back(entity.name);
  }
  std::erase_if(task.entities, [](const ScoredEntity& entity) { return entity.scored.empty(); });
  if (!task.entities.empty()) return task;
  return absl::InvalidArgumentError(
      absl::StrCat("no entity has a reference view and shows at least ", options.min_pixels,
                   " pixels in a view to score; there are ", task.views.size(), " views and ",
                   task.left_out.size(), " entities"));
}

std::optional<ReferenceTruth> ReferenceTruthOf(const EvaluationTask& task,
                                               const ScoredEntity& entity) {
  using Truth = std::optional<ReferenceTruth>;
  const TruthView& view = task.views[entity.reference];
  if (view.IndexOf(entity.name)) return ReferenceTruth{view.MaskOf(entity.name), view.ignore};
  const auto* shape = std::get_if<Shape>(&entity.prompt);
  if (shape == nullptr) return std::nullopt;
  return std::visit(
      Overloaded{[&](const BinaryMask& mask) -> Truth {
                   return ReferenceTruth{mask.pixels, view.ignore};
                 },
                 [](const Scribbles& scribbles) -> Truth {
                   if (scribbles.negative.pixels.empty()) return std::nullopt;
                   ReferenceTruth truth = {scribbles.positive.pixels, scribbles.negative.pixels};
                   for (size_t i = 0; i < truth.ignore.size(); ++i) {
                     truth.ignore[i] = truth.mask[i] == 0 && truth.ignore[i] == 0 ? 1 : 0;
                   }
                   return truth;
                 },
                 [](const auto&) -> Truth { return std::nullopt; }},
      *shape);
}

}  // namespace pepeseg
