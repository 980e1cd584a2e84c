#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/train/settings/training_settings.h"

namespace pepeseg {

void VisitOptions(TrainingSettings& settings, OptionVisitor visit) {
  VisitPart("import", settings.import, visit);
  VisitPart("priors", settings.priors, visit);
  VisitPart("sfm", settings.sfm, visit);
  VisitPart("reconstruct", settings.reconstruct, visit);
  VisitPart("features", settings.features, visit);
}

absl::Status Validate(const TrainingSettings& settings) {
  RETURN_IF_ERROR(Validate(settings.preset));
  RETURN_IF_ERROR(WithPrefix("import.", Validate(settings.import)));
  RETURN_IF_ERROR(WithPrefix("priors.", Validate(settings.priors)));
  RETURN_IF_ERROR(WithPrefix("sfm.", Validate(settings.sfm)));
  RETURN_IF_ERROR(WithPrefix("reconstruct.", Validate(settings.reconstruct)));
  return WithPrefix("features.", Validate(settings.features));
}

}  // namespace pepeseg
