#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/prompt.pb.h"
#include "server/services/view_images.h"

// Whether SAM helps to answer a prompt, where a request leaves that to the server.
namespace pepeseg {

// Returns whether SAM and the model can answer a prompt together: points or a box whose size nobody
// has given.
bool IsForSam(const v1::Prompt& prompt, const v1::Granularity& granularity);
// Returns INVALID_ARGUMENT for a prompt that is not.
absl::Status CheckForSam(const v1::Prompt& prompt, const v1::Granularity& granularity);

// Returns whether SAM improves the answers of a model and the server has it. A training with SAM
// has kept what SAM's decoder needs of each photograph, and a field that has learnt SAM's masks
// gains by SAM: tests/bench/results/sam_clicks.md, borders.md.
bool SuitsSam(const Model& model, const ViewImages& images);

// Returns whether SAM and the model answer a request's prompt together: as it asks or, where it
// leaves sam_clicks out, where that suits the model.
template <class Request>
bool AnswersBySam(const Request& request, const Model& model, const ViewImages& images) {
  if (request.has_sam_clicks()) return request.sam_clicks();
  return IsForSam(request.prompt(), request.granularity()) && SuitsSam(model, images);
}

// Returns whether an error is SAM's own, so that an answer without it is better than none.
bool IsSamsFault(const absl::Status& status);

}  // namespace pepeseg
