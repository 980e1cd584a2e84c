#include "core/train/photograph_segmentation.h"

#include <sys/resource.h>

#include <algorithm>
#include <memory>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/import.h"
#include "core/priors/sam/automatic_masks.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

// Increase of the nice value of low-priority threads. Where both want a core, such a thread gets
// about a tenth of the time that a thread of another stage gets.
constexpr int kNicer = 10;

// Lowers the priority of this thread and of the threads that it starts, once. Does nothing if the
// system refuses.
void LowerPriority() {
  thread_local bool is_low = false;
  if (is_low) return;
  is_low = true;
  setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + kNicer);
}

absl::Status OutOfMemory(const TrainingTools& tools) {
  return absl::ResourceExhaustedError(absl::StrCat(
      "SAM: out of memory: it needs about ", SamHostBytes(NumThreads(tools.num_threads)) >> 20,
      " MiB besides the photographs, and the job may take ", tools.memory_limit >> 20, " MiB"));
}

// Returns the declared SHA-256 of the uploaded photographs by their keys.
std::map<std::string, std::string> DigestsOf(const TrainingInputs& inputs) {
  std::map<std::string, std::string> digests;
  for (size_t i = 0; i < inputs.sha256.size(); ++i) {
    const DatasetFile& file = inputs.files[i];
    if (file.kind == FileKind::kImage) digests[PhotoKey(file.name)] = inputs.sha256[i];
  }
  return digests;
}

}  // namespace

// Tasks are sorted by the photographs' keys, as views are, so that the expected held-out views are
// known before there are views.
PhotographSegmentation::PhotographSegmentation(const TrainingInputs& inputs,
                                               const ImportOptions& import,
                                               const std::vector<DatasetFile>& files,
                                               bool next_to_other_stages)
    : inputs_(inputs),
      masks_(SamFolder(inputs.folders), import.image_scale),
      num_threads_(NumThreads(inputs.tools.num_threads)),
      first_priority_(next_to_other_stages ? Priority::kLow : Priority::kOfProcess) {
  std::map<std::string, const DatasetFile*> sorted;
  for (const DatasetFile& file : files) {
    if (file.kind == FileKind::kImage) sorted[PhotoKey(file.name)] = &file;
  }
  std::map<std::string, std::string> digests = DigestsOf(inputs);
  for (const auto& [key, file] : sorted) {
    const size_t task = tasks_.size();
    by_key_[key] = task;
    tasks_.push_back({*file, digests[key]});
    // The import's rule, applied to all photographs. COLMAP may leave some out, so WaitFor queues
    // again what the real views need.
    if (next_to_other_stages && !IsHeldOut(import, key, task)) queue_.push_back(task);
  }
  StartThreads(first_priority_);
}

PhotographSegmentation::~PhotographSegmentation() { Stop(); }

// The first thread of the object opens the model; the others wait for it in Next.
void PhotographSegmentation::StartThreads(Priority priority) {
  const bool on_device = inputs_.tools.sam_cuda_device.has_value();
  for (int i = 0; i < SamPhotographsAtOnce(num_threads_, on_device); ++i) {
    const bool opens = threads_.empty();
    threads_.emplace_back([this, priority, opens] {
      try {
        if (opens) OpenModel(priority);
        Work(priority);
      } catch (const std::bad_alloc&) {  // of the standard library or OpenCV
        Fail(absl::ResourceExhaustedError("out of memory"));
      }
    });
  }
}

// Interrupts the network, which may compute for seconds, and joins the threads.
void PhotographSegmentation::Stop() {
  stop_.request_stop();
  {
    const std::lock_guard lock(mutex_);
    if (model_ != nullptr) model_->Interrupt();
  }
  threads_.clear();
  model_.reset();
}

// Photographs that may be segmented at the same time. With mutex_ held.
int PhotographSegmentation::AtOnce() const {
  return SamPhotographsAtOnce(num_threads_, model_ != nullptr && model_->on_device());
}

// Verifies and loads the networks without the mutex, which takes seconds, then publishes them to
// the threads that wait in Next. The CPU's networks have the priority of the threads.
void PhotographSegmentation::OpenModel(Priority priority) {
  if (const absl::Status ready = masks_.Prepare(); !ready.ok()) return Fail(ready);
  SamOptions options = {.num_threads = num_threads_, .cuda_device = inputs_.tools.sam_cuda_device};
  if (priority == Priority::kLow) options.before_cpu = LowerPriority;
  auto model = SamModel::Open(inputs_.tools.sam, options);
  if (!model.ok()) return Fail(model.status());
  const std::lock_guard lock(mutex_);
  model_ = *std::move(model);
  changed_.notify_all();
}

// The loop of a thread. model_ is read without the mutex: once Next has returned a task, it is set
// and does not change until Stop has joined the threads.
void PhotographSegmentation::Work(Priority priority) {
  std::unique_ptr<PromptedSegmenter> segmenter;
  while (const std::optional<size_t> task = Next(priority)) {
    if (priority == Priority::kLow && !model_->on_device()) LowerPriority();
    if (segmenter == nullptr) segmenter = model_->MakeSegmenter();
    const absl::Status status = Segment(*task, *segmenter);
    if (!status.ok()) return Fail(status);
  }
}

// Waits for a photograph to segment and returns its task. Returns nullopt when none is left for a
// thread of this priority, after a failure, or when the object stops.
std::optional<size_t> PhotographSegmentation::Next(Priority priority) {
  std::unique_lock lock(mutex_);
  // Low-priority threads end when the queue is closed, though tasks are left: the threads that
  // WaitFor starts do them.
  const auto ends = [&] {
    return !status_.ok() || (closed_ && (queue_.empty() || priority == Priority::kLow));
  };
  // Old and new threads overlap for a while; num_running_ keeps the memory within its limit.
  const auto may_begin = [&] {
    return model_ != nullptr && !queue_.empty() && num_running_ < AtOnce();
  };
  // The token also ends the wait: Stop does not notify changed_.
  changed_.wait(lock, stop_.get_token(), [&] { return ends() || may_begin(); });
  if (stop_.stop_requested() || ends()) return std::nullopt;
  const size_t task = queue_.front();
  queue_.pop_front();
  tasks_[task].state = Task::kRuns;
  ++num_running_;
  return task;
}

// Computes without the mutex; only the states are changed with it held.
absl::Status PhotographSegmentation::Segment(size_t task, PromptedSegmenter& segmenter) {
  const DatasetFile& photograph = tasks_[task].photograph;
  const bool kept = masks_.Has(task, photograph);
  if (!kept) {
    const EmbeddingOrigin origin = {model_->encoder_digest(), tasks_[task].sha256};
    RETURN_IF_ERROR(masks_.Make(task, photograph, segmenter,
                                inputs_.tools.keep_embeddings ? &origin : nullptr));
  }
  const std::lock_guard lock(mutex_);
  tasks_[task].state = Task::kDone;
  num_kept_ += kept ? 1 : 0;
  --num_running_;
  changed_.notify_all();
  return absl::OkStatus();
}

// Keeps the first failure. It ends all threads and WaitFor.
void PhotographSegmentation::Fail(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  if (status_.ok()) status_ = status;
  changed_.notify_all();
}

// Returns the tasks of the training views' photographs, in the order of the views.
std::vector<size_t> PhotographSegmentation::Trained(const Capture& capture) const {
  std::vector<size_t> photographs;
  for (const View& view : capture.views) {
    if (!view.held_out) photographs.push_back(by_key_.at(view.name));
  }
  return photographs;
}

int64_t PhotographSegmentation::NumDone(const std::vector<size_t>& tasks) const {
  return std::count_if(tasks.begin(), tasks.end(),
                       [this](size_t task) { return tasks_[task].state == Task::kDone; });
}

int64_t PhotographSegmentation::NumLeft(const Capture& capture) const {
  const std::vector<size_t> trained = Trained(capture);
  const std::lock_guard lock(mutex_);
  return static_cast<int64_t>(trained.size()) - NumDone(trained);
}

// Replaces the queue by the open ones of these tasks, closes it, and returns how many are done.
int64_t PhotographSegmentation::CloseQueue(const std::vector<size_t>& tasks) {
  const std::lock_guard lock(mutex_);
  queue_.clear();
  for (const size_t task : tasks) {
    if (tasks_[task].state == Task::kOpen) queue_.push_back(task);
  }
  closed_ = true;
  changed_.notify_all();
  return NumDone(tasks);
}

// Reports the share of the work left at the start of the wait: photographs that were segmented
// before cost no time now.
absl::Status PhotographSegmentation::WaitFor(const std::vector<size_t>& tasks, StageLog& stages) {
  const auto num_photographs = static_cast<int64_t>(tasks.size());
  const int64_t num_before = CloseQueue(tasks);
  if (first_priority_ == Priority::kLow) StartThreads(Priority::kOfProcess);
  for (int64_t num_done = 0; num_done < num_photographs;) {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return !status_.ok() || NumDone(tasks) > num_done; });
      RETURN_IF_ERROR(status_);
      num_done = NumDone(tasks);
    }
    const double left = std::max<double>(1, static_cast<double>(num_photographs - num_before));
    const double share = 1 - static_cast<double>(num_photographs - num_done) / left;
    RETURN_IF_ERROR(stages.Step({.step = num_done,
                                 .num_steps = num_photographs,
                                 .activity = "segmenting",
                                 .unit = "photographs",
                                 .share = kShareBeforeSam + (1 - kShareBeforeSam) * share}));
  }
  return absl::OkStatus();
}

// Returns the masks of the training views, in their order. None is given to a view before all could
// be read.
absl::StatusOr<std::vector<MaskSet>> PhotographSegmentation::MasksOfViews(
    bool join, const Capture& capture) const {
  std::vector<const View*> views;
  for (const View& view : capture.views) {
    if (!view.held_out) views.push_back(&view);
  }
  ThreadPool pool(num_threads_);
  std::vector<MaskWarp> warps(static_cast<size_t>(pool.num_threads()));
  std::vector<absl::StatusOr<MaskSet>> made(views.size());
  pool.ParallelFor(static_cast<int64_t>(views.size()), [&](int64_t i, int thread) {
    try {
      made[i] = MasksOfView(*views[i], join, warps[thread]);
    } catch (const std::bad_alloc&) {  // of the standard library or OpenCV
      made[i] = absl::ResourceExhaustedError("out of memory");
    }
  });
  std::vector<MaskSet> masks;
  for (absl::StatusOr<MaskSet>& of_view : made) {
    RETURN_IF_ERROR(of_view.status());
    masks.push_back(*std::move(of_view));
  }
  return masks;
}

absl::StatusOr<MaskSet> PhotographSegmentation::MasksOfView(const View& view, bool join,
                                                            MaskWarp& warp) const {
  const Photograph& photograph = *view.photograph;  // every imported view has one
  ASSIGN_OR_RETURN(
      const MaskSet masks,
      masks_.Read(by_key_.at(view.name), photograph.UprightWidth(), photograph.UprightHeight()));
  return JoinMasks(warp.ToView(masks, view), join ? view.masks : MaskSet(), view.ignore);
}

// A failure of CUDA is a warning: the CPU takes a thousand times as long.
void PhotographSegmentation::ReportProcessor(StageLog& stages) {
  std::string message;
  bool failed = false;
  {
    const std::lock_guard lock(mutex_);
    if (model_ == nullptr) return;
    message = absl::StrCat("SAM: computed on ", model_->processor());
    failed = model_->cuda_failed();
  }
  failed ? stages.Warn(message) : stages.observer().Log(message);
}

// Frees the networks before the masks are read and warped.
absl::Status PhotographSegmentation::TakeMasks(StageLog& stages, bool join, Capture& capture) {
  RETURN_IF_ERROR(WaitFor(Trained(capture), stages));
  ReportProcessor(stages);
  Stop();
  if (num_kept_ > 0) {
    stages.observer().Log(
        absl::StrCat("SAM: ", num_kept_, " photographs were segmented by an earlier attempt"));
  }
  ASSIGN_OR_RETURN(std::vector<MaskSet> made, MasksOfViews(join, capture));
  size_t next = 0;
  for (View& view : capture.views) {
    if (!view.held_out) view.masks = std::move(made[next++]);
  }
  return absl::OkStatus();
}

absl::Status PhotographSegmentation::GiveMasks(StageLog& stages, bool join, Capture& capture) {
  const absl::Status status = [&] {
    try {
      return TakeMasks(stages, join, capture);
    } catch (const std::bad_alloc&) {  // of the standard library
      return absl::ResourceExhaustedError("out of memory");
    }
  }();
  return absl::IsResourceExhausted(status) ? OutOfMemory(inputs_.tools) : status;
}

}  // namespace pepeseg
