#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/render_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/job_snapshots.h"
#include "server/services/selections.h"

namespace pepeseg {

// Answers RenderView calls. Both must outlive it.
class RenderAnswers {
 public:
  RenderAnswers(JobSnapshots& models, const Selections& selections)
      : models_(models), selections_(selections) {}

  // Blocks for as long as the model takes to load and, if the request names or asks for segments,
  // to be decomposed.
  absl::Status Render(const UnaryCall& call, const v1::RenderViewRequest& request,
                      v1::RenderViewResponse* response) const;

 private:
  JobSnapshots& models_;
  const Selections& selections_;
};

}  // namespace pepeseg
