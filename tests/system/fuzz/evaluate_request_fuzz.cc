#include "absl/status/status.h"
#include "server/api/convert_evaluation.h"
#include "server/api/evaluation_prompts.h"
#include "server/api/evaluation_views.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

PEPESEG_FUZZ_MESSAGE(evaluate_request, pepeseg::v1::EvaluateModelRequest) {
  static pepeseg::fuzz::SmallModel small;
  const auto wanted = [] { return absl::OkStatus(); };
  const pepeseg::Model& model = small.model().model();
  const auto views = pepeseg::ReadTruthViews(message, model, wanted);
  if (views.ok()) (void)pepeseg::ReadEntityPrompts(message, *views, small.reader(), {});
  (void)pepeseg::ReadSamViews(message, model, wanted);
  const auto options = pepeseg::EvaluationOptionsFromProto(message.options());
  if (!options.ok()) return;
  const bool accept_trained = message.options().accept_trained_views();
  pepeseg::fuzz::Expect(
      pepeseg::EvaluationOptionsFromProto(pepeseg::ToProto(*options, accept_trained)).ok(),
      "effective options to be valid");
}
