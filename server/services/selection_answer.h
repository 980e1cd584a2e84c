#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/selection.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/unary.h"

// Answers to calls about selections, with the errors of the contract. All of them block; the first
// two compute.
namespace pepeseg {

absl::Status AnswerSelect(const UnaryCall& call, const ServiceContext& context,
                          const v1::SelectRequest& request, v1::Selection* response);
absl::Status AnswerCombineSelections(const ServiceContext& context,
                                     const v1::CombineSelectionsRequest& request,
                                     v1::Selection* response);
absl::Status AnswerUndoSelection(const ServiceContext& context,
                                 const v1::UndoSelectionRequest& request, v1::Selection* response);
absl::Status AnswerGetSelection(const ServiceContext& context,
                                const v1::GetSelectionRequest& request, v1::Selection* response);
absl::Status AnswerListSelections(const ServiceContext& context,
                                  const v1::ListSelectionsRequest& request,
                                  v1::ListSelectionsResponse* response);
absl::Status AnswerDeleteSelection(const ServiceContext& context,
                                   const v1::DeleteSelectionRequest& request);

}  // namespace pepeseg
