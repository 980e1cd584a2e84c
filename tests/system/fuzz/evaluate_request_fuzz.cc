#include "server/api/evaluation.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

PEPESEG_FUZZ_MESSAGE(evaluate_request, pepeseg::v1::EvaluateModelRequest) {
  static pepeseg::fuzz::SmallModel small;
  (void)pepeseg::ReadLabels(message, small.segmenter().model());
  const auto options = pepeseg::OneClickOptionsFromProto(message.options());
  if (!options.ok()) return;
  pepeseg::fuzz::Expect(pepeseg::OneClickOptionsFromProto(pepeseg::ToProto(*options)).ok(),
                        "effective options to be valid");
}
