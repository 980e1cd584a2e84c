#include "server/services/seen_models.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {

absl::StatusOr<SeenModels::Seen> SeenModels::Take(const ResidentModel& model,
                                                  const WantedCheck& check) {
  // Not model.name: scenes of two projects may have one name.
  std::string key = absl::StrCat(model.id.scene.id, "/", model.id.number);
  const auto at = std::ranges::find(recent_, key, &Seen::key);
  if (at != recent_.end()) {
    Seen kept = std::move(*at);
    recent_.erase(at);
    bytes_ -= kept.bytes;
    return kept;
  }
  SceneSegments segments;
  RETURN_IF_ERROR(
      model->Decompose(kPieceDecompositionScales, [&](const Decomposition& whole) -> absl::Status {
        ASSIGN_OR_RETURN(segments, SeeSegments(*model, whole, kMostSeenViews, check));
        return absl::OkStatus();
      }));
  Seen seen;
  seen.key = std::move(key);
  seen.segments = std::make_shared<const SceneSegments>(std::move(segments));
  return seen;
}

void SeenModels::Keep(Seen seen) {
  seen.bytes = seen.segments->Bytes() + (seen.looks == nullptr ? 0 : seen.looks->Bytes());
  if (seen.bytes > max_bytes_) return;
  while (bytes_ + seen.bytes > max_bytes_) {
    bytes_ -= recent_.back().bytes;
    recent_.pop_back();
  }
  bytes_ += seen.bytes;
  recent_.push_front(std::move(seen));
}

int64_t SeenModels::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

absl::StatusOr<std::shared_ptr<const SceneSegments>> SeenModels::Segments(
    const ResidentModel& model, const WantedCheck& check) {
  const std::lock_guard lock(mutex_);
  ASSIGN_OR_RETURN(Seen seen, Take(model, check));
  std::shared_ptr<const SceneSegments> segments = seen.segments;
  Keep(std::move(seen));
  return segments;
}

absl::StatusOr<std::shared_ptr<const Appearance>> SeenModels::Looks(const ResidentModel& model,
                                                                    ImageEncoder& encoder,
                                                                    const WantedCheck& check) {
  const std::lock_guard lock(mutex_);
  ASSIGN_OR_RETURN(Seen seen, Take(model, check));
  absl::Status status;
  if (seen.looks == nullptr) {
    auto looks = Appearance::Look(*model, *seen.segments, encoder, check);
    status = looks.status();
    if (looks.ok()) seen.looks = std::make_shared<const Appearance>(*std::move(looks));
  }
  std::shared_ptr<const Appearance> looks = seen.looks;
  Keep(std::move(seen));
  RETURN_IF_ERROR(status);
  return looks;
}

absl::StatusOr<SeenView> SeeViewOf(const SceneModel& model, const SceneSegments& all,
                                   const ModelView& view) {
  SeenView seen;
  RETURN_IF_ERROR(
      model.Decompose(kPieceDecompositionScales, [&](const Decomposition& whole) -> absl::Status {
        ASSIGN_OR_RETURN(seen, SeeView(model, whole, all, view));
        return absl::OkStatus();
      }));
  return seen;
}

}  // namespace pepeseg
