#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/benchmark/evaluation_truth.h"
#include "pepeseg/v1/evaluation_service.pb.h"

// The prompts of an evaluation, as the verb "evaluate" takes them.
namespace pepeseg::client::cli {

struct EntityPromptFlags {
  std::vector<std::string> prompts = {};  // see AddEntityPrompt
  std::string file = {};                  // with a prompt a line; empty: none
  std::string reference = {};             // a view whose masks are the prompts of their entities
};

// Adds a prompt "ENTITY@VIEW:KIND:VALUE" to a request and returns its view; "": a label has its
// own.
//   mug@a.jpg:points:440,280;-100,80    clicks, a minus before those on something else
//   mug@a.jpg:mean:440,280;450,290      the mean feature of pixels
//   mug@a.jpg:box:400,250,90,60         x, y, width, height
//   mug@a.jpg:mask:FILE.png
//   mug@a.jpg:scribbles:POSITIVE.png,NEGATIVE.png    the second may be left out
//   mug@a.jpg:own-mask                  the mask of the entity in the truth
//   mug@:label:red                      a label of the scene
// INVALID_ARGUMENT: it is malformed, or the entity has a prompt. LocalFileError: a file cannot be
// read.
absl::StatusOr<std::string> AddEntityPrompt(const std::string& text,
                                            v1::EvaluateModelRequest& request);

// Adds the prompts that the flags give to a request with its truth, and reference views without
// truth to its views. INVALID_ARGUMENT: a prompt is malformed, or the reference view has no mask.
absl::Status AddEntityPrompts(const EntityPromptFlags& flags, const TruthFlags& truth,
                              v1::EvaluateModelRequest& request);

}  // namespace pepeseg::client::cli
