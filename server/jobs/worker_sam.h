#pragma once

#include "absl/status/status.h"
#include "core/priors/prior_options.h"
#include "core/scene/capture.h"
#include "server/jobs/worker_job.h"
#include "server/jobs/worker_stage_log.h"

namespace pepeseg {

// Embedded masks, which come before SAM's, as a share of the work of stage "priors".
inline constexpr double kShareBeforeSam = 0.1;

// Whether SAM makes the masks of a job whose priors command has made none.
bool UsesSam(const WorkerJob& job, PriorMaker masks);

// Replaces the masks of the views that are trained on by SAM's, and joins them with those that they
// have if `masks` is kSamAndEmbedded. The masks that the views have, embedded ones, may also say
// where SAM is asked. What is done for a photograph is kept in the job's folder, so that a further
// attempt need not do it again.
//
// CANCELLED: the job was told to stop. Any other error, of OpenSam or because there is not enough
// memory, leaves all views with the masks that they had.
absl::Status SegmentViews(const WorkerJob& job, PriorMaker masks, StageLog& stages,
                          Capture& capture);

}  // namespace pepeseg
