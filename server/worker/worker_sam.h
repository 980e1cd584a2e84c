#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/priors/prior_options.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_photograph_masks.h"
#include "server/worker/worker_stage_log.h"

namespace pepeseg {

// Share of the work of stage "priors" before its first photograph is waited for.
inline constexpr double kShareBeforeSam = 0.1;

// Whether SAM makes the masks of a job whose priors command has made none.
bool UsesSam(const WorkerJob& job, PriorMaker masks);

// Masks of a job's photographs by SAM, which threads of this object make while the job does other
// things: a photograph can be segmented before its pose is known. What is done for a photograph is
// kept in the job's folder, so that a further attempt need not do it again.
//
// The job's thread calls the methods. The object's threads take photographs from a queue, at most
// SamPhotographsAtOnce() at a time. Threads that were started while poses are wanted have a low
// priority, which the system lets no thread raise: they end after the photograph that each is at
// when GiveMasks begins, and others of the job's priority take over.
class PhotographSegmentation {
 public:
  // Begins. `files`: of the job, the photographs among them.
  //
  // `poses_are_wanted`: their poses are being estimated. The photographs that will be trained on if
  // all get a pose are segmented meanwhile, by what COLMAP leaves of the cores. Those that will be
  // held out are not, nor any before GiveMasks where poses are known.
  PhotographSegmentation(const WorkerJob& job, const ImportOptions& import,
                         const std::vector<DatasetFile>& files, bool poses_are_wanted);
  // Stops at once.
  ~PhotographSegmentation();

  // Photographs of training views that are still to be segmented.
  int64_t NumLeft(const Capture& capture) const;

  // Waits for the masks of the training views' photographs and gives them to the views, joined with
  // those that the views have if `join`; steps of the stage "priors". Called once.
  //
  // CANCELLED: the job was told to stop. Any other error, of SamModel or because there is not
  // enough memory, leaves all views with the masks that they had.
  absl::Status GiveMasks(StageLog& stages, bool join, Capture& capture);

 private:
  struct Task {
    DatasetFile photograph;
    enum { kOpen, kRuns, kDone } state = kOpen;
  };
  enum class Priority { kOfJob, kLow };

  void StartThreads(Priority priority);
  void Stop();

  // On the object's threads.
  void OpenModel();
  void Work(Priority priority);
  std::optional<size_t> Next(Priority priority);
  absl::Status Segment(size_t task, PromptedSegmenter& segmenter);
  void Fail(const absl::Status& status);

  // On the job's thread.
  std::vector<size_t> Trained(const Capture& capture) const;
  int64_t CloseQueue(const std::vector<size_t>& tasks);
  absl::Status WaitFor(const std::vector<size_t>& tasks, StageLog& stages);
  absl::StatusOr<std::vector<MaskSet>> MasksOfViews(bool join, const Capture& capture) const;
  absl::Status TakeMasks(StageLog& stages, bool join, Capture& capture);

  int64_t NumDone(const std::vector<size_t>& tasks) const;  // under mutex_

  const WorkerJob& job_;
  const PhotographMasks masks_;
  const int num_threads_;
  const Priority first_priority_;
  std::map<std::string, size_t> by_key_;  // index in tasks_, the photograph's number in masks_
  std::stop_source stop_;

  mutable std::mutex mutex_;             // of what follows
  std::condition_variable_any changed_;  // likewise
  std::vector<Task> tasks_;              // in the order of views; only their states change
  std::deque<size_t> queue_;
  bool closed_ = false;              // nothing will be queued any more, and poses are known
  int num_running_ = 0;              // photographs
  int64_t num_kept_ = 0;             // photographs that an earlier attempt has segmented
  absl::Status status_;              // the first failure
  std::unique_ptr<SamModel> model_;  // null: not opened yet

  std::vector<std::jthread> threads_;  // the first opens the model
};

}  // namespace pepeseg
