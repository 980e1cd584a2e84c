#include "server/services/seen_models.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr size_t kMostSeenModels = 2;

}  // namespace

absl::StatusOr<SeenModels::Seen*> SeenModels::Find(const ResidentModel& model,
                                                   const WantedCheck& check) {
  // Not model.name: scenes of two projects may have one name.
  const std::string key = absl::StrCat(model.id.scene.id, "/", model.id.number);
  for (auto at = recent_.begin(); at != recent_.end(); ++at) {
    if (at->key != key) continue;
    recent_.splice(recent_.begin(), recent_, at);
    return &recent_.front();
  }
  SceneSegments segments;
  RETURN_IF_ERROR(model->Decompose(
      kDefaultDecompositionScales, [&](const Decomposition& whole) -> absl::Status {
        ASSIGN_OR_RETURN(segments, SeeSegments(*model, whole, kMostSeenViews, check));
        return absl::OkStatus();
      }));
  recent_.push_front({key, std::make_shared<const SceneSegments>(std::move(segments)), nullptr});
  if (recent_.size() > kMostSeenModels) recent_.pop_back();
  return &recent_.front();
}

absl::StatusOr<std::shared_ptr<const SceneSegments>> SeenModels::Segments(
    const ResidentModel& model, const WantedCheck& check) {
  const std::lock_guard lock(mutex_);
  ASSIGN_OR_RETURN(const Seen* seen, Find(model, check));
  return seen->segments;
}

absl::StatusOr<std::shared_ptr<const Appearance>> SeenModels::Looks(const ResidentModel& model,
                                                                    ImageEncoder& encoder,
                                                                    const WantedCheck& check) {
  const std::lock_guard lock(mutex_);
  ASSIGN_OR_RETURN(Seen * seen, Find(model, check));
  if (seen->looks == nullptr) {
    ASSIGN_OR_RETURN(Appearance looks, Appearance::Look(*model, *seen->segments, encoder, check));
    seen->looks = std::make_shared<const Appearance>(std::move(looks));
  }
  return seen->looks;
}

absl::StatusOr<SeenView> SeeViewOf(const SceneModel& model, const SceneSegments& all,
                                   const ModelView& view) {
  SeenView seen;
  RETURN_IF_ERROR(
      model.Decompose(kDefaultDecompositionScales, [&](const Decomposition& whole) -> absl::Status {
        ASSIGN_OR_RETURN(seen, SeeView(model, whole, all, view));
        return absl::OkStatus();
      }));
  return seen;
}

}  // namespace pepeseg
