#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/priors/sam/decoder_network.h"
#include "core/priors/sam/mask_proposals.h"
#include "core/scene/capture.h"

// The steps of SegmentPhotograph on a backend. Logits stay there: only masks that are kept are
// copied to the host. Errors are those of DecoderNetwork::Decode.
namespace pepeseg {

// Asks a decoder at once: the same as ProposeBySegmenting does with that decoder's logits, where
// the request has no settled_area, which is ignored.
absl::StatusOr<Proposals> ProposeOnBackend(Backend& backend, DecoderNetwork& decoder,
                                           ConstNetworkSpan embedding,
                                           const ProposalRequest& request);

// The same as MatchBySegmenting, for a photograph with this grid.
absl::StatusOr<std::vector<ProposedMask>> MatchOnBackend(Backend& backend, DecoderNetwork& decoder,
                                                         ConstNetworkSpan embedding,
                                                         const PromptAnswers& grid,
                                                         std::span<const TargetedPrompt> prompts);

// PixelsOfLogits of the masks, with `extent` cells along the photograph's longer side.
absl::StatusOr<std::vector<std::vector<PixelRun>>> EnlargeOnBackend(
    Backend& backend, int extent, std::span<const ProposedMask> masks, const View& view);

// Appends a prompt and the padding point that SAM expects at the end of a prompt without a box.
void AppendPrompt(const SegmenterPrompt& prompt, const PromptAnswers& grid,
                  const DecoderNetwork& decoder, std::vector<DecoderPoint>& points);
// Appends the points and the box of a prompt by a mask, which need no padding point.
void AppendPrompt(const MaskPrompt& prompt, const PromptAnswers& grid,
                  const DecoderNetwork& decoder, std::vector<DecoderPoint>& points);

}  // namespace pepeseg
