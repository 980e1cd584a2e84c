#include "server/api/evaluation_prompts.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

// Returns the truth of a view of the request; null: it has none of this name.
const TruthView* FindTruth(std::span<const TruthView> views, const std::string& name) {
  const auto found = std::find_if(views.begin(), views.end(),
                                  [&](const TruthView& truth) { return truth.view.name == name; });
  return found == views.end() ? nullptr : &*found;
}

absl::Status CheckEntity(std::span<const TruthView> views, const std::string& entity,
                         const std::string& field) {
  const bool known = std::any_of(views.begin(), views.end(),
                                 [&](const TruthView& truth) { return truth.IndexOf(entity); });
  if (known) return absl::OkStatus();
  return BadField(field, entity, "no view has a mask of this entity");
}

absl::Status CheckOwnMask(std::span<const TruthView> views, const std::string& entity,
                          const std::string& view, const std::string& field) {
  RETURN_IF_ERROR(CheckEntity(views, entity, field));
  const TruthView* truth = FindTruth(views, view);
  if (truth == nullptr) return BadField(field, view, "not a view of the request");
  if (truth->IndexOf(entity)) return absl::OkStatus();
  return BadField(field, view, "has no mask of the entity");
}

}  // namespace

absl::StatusOr<std::vector<EntityPrompt>> ReadEntityPrompts(const v1::EvaluateModelRequest& request,
                                                            std::span<const TruthView> views,
                                                            const SegmentRequestReader& reader,
                                                            const TruthFrames& frames) {
  const size_t num_given = request.prompts().size() + request.own_masks().size();
  if (request.options().protocol() == v1::EVALUATION_PROTOCOL_CLICKS && num_given > 0) {
    return BadField("prompts", absl::StrCat(num_given),
                    "prompts; the protocol CLICKS makes its own, give none");
  }
  const auto image_of = [&](const ModelView& view) {
    return frames.Image(view, request.frame(), TruthFrames::Kind::kPrompt);
  };
  std::vector<EntityPrompt> prompts;
  // By name, so that the same request has the same error.
  const std::map<std::string, v1::Prompt> given(request.prompts().begin(), request.prompts().end());
  for (const auto& [entity, proto] : given) {
    const std::string field = absl::StrCat("prompts[", entity, "]");
    RETURN_IF_ERROR(CheckEntity(views, entity, field));
    ASSIGN_OR_RETURN(Prompt prompt, reader.ReadPrompt(proto, image_of, field));
    if (FindTruth(views, prompt.view.name) == nullptr) {
      return BadField(field + ".view", prompt.view.name, "not a view of the request");
    }
    prompts.push_back({entity, prompt.view.name, std::move(prompt.what)});
  }
  const std::map<std::string, std::string> own(request.own_masks().begin(),
                                               request.own_masks().end());
  for (const auto& [entity, view] : own) {
    const std::string field = absl::StrCat("own_masks[", entity, "]");
    RETURN_IF_ERROR(CheckOwnMask(views, entity, view, field));
    if (given.contains(entity)) return BadField(field, entity, "has a prompt already");
    prompts.push_back({entity, view, OwnMask{}});
  }
  return prompts;
}

}  // namespace pepeseg
