#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/sam_agreement.h"
#include "core/evaluate/truth_view.h"
#include "core/query/prompt.h"

// What an evaluation scores: entities with a prompt in a reference view, and the views in which
// their masks are compared with the truth.

namespace pepeseg {

// One click on the deepest pixel of the entity's mask in the reference view.
struct DeepestClick {};
// The entity's own mask in the reference view: the mask of its label.
struct OwnMask {};
using PromptShape = std::variant<DeepestClick, OwnMask, Shape>;

// The prompt of an entity. It makes `view` the entity's reference, which need not show enough
// pixels of the entity to be scored, nor have its mask.
struct EntityPrompt {
  std::string entity;
  std::string view;
  PromptShape shape;
};

struct EvaluationRequest {
  std::vector<TruthView> views;       // each name once; a reference view may have no masks
  std::vector<EntityPrompt> prompts;  // at most one an entity; without one: DeepestClick
  std::vector<SamView> sam_views;     // of the protocol "agreement with SAM", which reads no others
  // Accepts views that the model was trained on. Scores there say less about the model: use it for
  // protocols that define it so.
  bool accept_trained_views = false;
};

struct TaskOptions {
  int64_t min_pixels = 100;      // pixels of an entity that a scored view must show, at least 1
  bool score_reference = false;  // scores the reference view, too
};

struct ScoredEntity {
  std::string name;
  std::string category;  // CategoryOf(name)
  size_t reference = 0;  // index of the view with the prompt
  PromptShape prompt;
  std::vector<size_t> scored;       // indices of the scored views, at least one
  std::vector<int64_t> num_pixels;  // [scored] pixels of the entity, without ignored ones
};

inline constexpr size_t kMaxEntities = 1000;

struct EvaluationTask {
  std::vector<TruthView> views;        // by name
  std::vector<ScoredEntity> entities;  // by name
  std::vector<std::string> left_out;   // names of entities without a scored view
};

// Chooses reference and scored views of each entity. Without a prompt, the reference is the first
// view by name that shows min_pixels of the entity. Scored are all other views that show
// min_pixels, and the reference itself if score_reference is set. Returns INVALID_ARGUMENT, which
// names the view or the entity, if a view comes twice or was trained on without
// accept_trained_views, if a prompt names an unknown view or entity, comes twice or does not fit
// its view, if no entity is left, or if there are more than kMaxEntities.
absl::StatusOr<EvaluationTask> MakeTask(EvaluationRequest request, const TaskOptions& options);

// What is known of an entity in its reference view, to choose a scale by.
struct ReferenceTruth {
  std::vector<uint8_t> mask;    // [height, width] of 0 and 1
  std::vector<uint8_t> ignore;  // as TruthView::ignore
};
// Returns the entity's mask in the reference view or, if the view does not have it, the mask of the
// prompt. Of scribbles only their pixels count, if both signs are given. Returns nothing for other
// prompts.
std::optional<ReferenceTruth> ReferenceTruthOf(const EvaluationTask& task,
                                               const ScoredEntity& entity);

// Returns INVALID_ARGUMENT unless the view was held out or `accept_trained`.
absl::Status CheckHeldOut(const ModelView& view, bool accept_trained);

// Returns `status` with the names of entity and reference view in front of its message.
absl::Status InReference(const EvaluationTask& task, const ScoredEntity& entity,
                         const absl::Status& status);

}  // namespace pepeseg
