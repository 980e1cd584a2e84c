#include "core/prompt/resolve_prompt.h"
#include "server/services/segment_question.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

// A question that is taken is answered, or refused by the model with a reason.
PEPESEG_FUZZ_MESSAGE(segment_request, pepeseg::v1::SegmentRequest) {
  static pepeseg::fuzz::SmallModel small;
  const auto question = pepeseg::ReadQuestion(small.context(), small.resident(), message);
  if (!question.ok()) return;
  // Free cameras of any size are for the answer's limits to refuse.
  if (question->prompt.view.camera.width > 64 || question->prompt.view.camera.height > 64) return;
  const pepeseg::Segmenter& segmenter = *small.resident().segmenter;
  const auto query = pepeseg::ResolvePrompt(segmenter, question->prompt, question->granularity);
  if (!query.ok()) return;
  if (question->targets.size() > 2) return;
  const auto results = segmenter.Segment(*query, question->targets, true);
  if (!results.ok()) return;
  pepeseg::fuzz::Expect(results->size() == question->targets.size(), "a mask for each view");
}
