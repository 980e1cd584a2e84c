#include "server/services/word_photographs.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "core/model_files/model_version.h"

namespace pepeseg {

absl::StatusOr<Image> WordPhotographs::Of(const ResidentModel& model, const ModelView& view,
                                          const WantedCheck& check) const {
  RETURN_IF_ERROR(check());
  const auto wanted = [&] { return check().ok(); };
  // Photographs do not show an edited model: in them words would find what was removed.
  if (!view.name.empty() && view.photograph && !IsEdited(model->model())) {
    StoredPhotographs photographs(deps_.store, deps_.blobs, deps_.photographs, model.id, wanted);
    auto photo = photographs.Formed(view, {.view = view, .max_side = kMaxSide});
    if (photo.ok()) return photo;
    RETURN_IF_ERROR(check());
    // The view is a frame of a video, or its photograph was deleted.
    spdlog::debug("words: view {}: {}", view.name, photo.status().ToString());
  }
  ASSIGN_OR_RETURN(Image rendering, model->segmenter().RenderColor(view));
  return ShrunkTo(std::move(rendering), kMaxSide);
}

}  // namespace pepeseg
