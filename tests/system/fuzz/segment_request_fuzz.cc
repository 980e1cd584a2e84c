#include "core/query/resolve_prompt.h"
#include "server/api/segment_request.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

// A request that is accepted is answered, or refused by the model with a reason.
PEPESEG_FUZZ_MESSAGE(segment_request, pepeseg::v1::SegmentViewsRequest) {
  static pepeseg::fuzz::SmallModel small;
  const auto asked = small.reader().Read(message);
  if (!asked.ok()) return;
  // Free cameras of any size are for the answer's limits to refuse.
  if (asked->prompt.view.camera.width > 64 || asked->prompt.view.camera.height > 64) return;
  const pepeseg::Segmenter& segmenter = small.segmenter();
  const auto query = pepeseg::ResolvePrompt(segmenter, asked->prompt, asked->granularity);
  if (!query.ok()) return;
  if (asked->targets.size() > 2) return;
  const auto results =
      segmenter.Segment(*query, asked->targets, {.want_similarity = true, .refine_borders = true});
  if (!results.ok()) return;
  pepeseg::fuzz::Expect(results->size() == asked->targets.size(), "a mask for each view");
}
