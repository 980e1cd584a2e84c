#include "server/rpc/stream.h"

#include <utility>

#include "absl/time/clock.h"
#include "server/api/error.h"
#include "server/rpc/stream_registry.h"

namespace pepeseg {

void Stream::Begin() {
  {
    const std::lock_guard lock(mutex_);
    // The stream owns itself until Done(), since gRPC holds only a raw pointer to its reactor.
    self_ = shared_from_this();
  }
  registry_->Add(self_);  // may call End
  const std::lock_guard lock(mutex_);
  if (state_ == State::kIdle) SubmitLocked();
}

// Queues Work() if nothing is under way; otherwise remembers the wake-up, and RunTask() works again
// before it becomes idle. Thus Work() never runs twice at the same time, and no wake-up is lost.
void Stream::Wake() {
  const std::lock_guard lock(mutex_);
  if (state_ == State::kIdle) {
    SubmitLocked();
  } else {
    wake_ = true;
  }
}

void Stream::Tick() {
  {
    const std::lock_guard lock(mutex_);
    if (state_ == State::kIo && !ending_ && absl::Now() - io_since_ > io_limit()) {
      const absl::Status status = TooSlowError(io_limit());
      // A write in progress must end before Finish, so it is cancelled, and its reaction finishes
      // the call.
      if (may_finish_during_io()) return FinishLocked(status);
      ending_ = true;  // IoDone finishes the call
      end_status_ = status;
      return CancelCall();
    }
  }
  Wake();
}

absl::Status Stream::Admit(const StreamOwner& owner) {
  {
    const std::lock_guard lock(mutex_);
    project_ = owner.project;
  }
  return registry_->Admit(this, owner);
}

void Stream::End(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  // The first reason to end counts.
  if (state_ == State::kFinished || ending_) return;
  ending_ = true;
  end_status_ = status;
  if (state_ == State::kIdle || (state_ == State::kIo && may_finish_during_io())) {
    FinishLocked(status);
  }
}

bool Stream::cancelled() const {
  const std::lock_guard lock(mutex_);
  // Also true for a stream that is being ended, so that computing an answer does not delay the end.
  return cancelled_ || ending_ || state_ == State::kFinished;
}

void Stream::IoDone(bool ok) {
  const std::lock_guard lock(mutex_);
  // The call was finished while a read was in progress.
  if (state_ != State::kIo) return;
  io_ok_ = ok;
  if (ending_) {
    FinishLocked(end_status_);
  } else if (cancelled_ || (!ok && !may_finish_during_io())) {
    FinishLocked(absl::CancelledError("the client is gone"));
  } else {
    SubmitLocked();
  }
}

void Stream::Cancelled() {
  const std::lock_guard lock(mutex_);
  cancelled_ = true;
  // While it works or writes, Run or IoDone finishes the call.
  if (state_ == State::kIdle || (state_ == State::kIo && may_finish_during_io())) {
    FinishLocked(absl::CancelledError("the client is gone"));
  }
}

void Stream::Done() {
  registry_->Remove(this);
  OnClosed();
  std::shared_ptr<Stream> self;
  const std::lock_guard lock(mutex_);
  self.swap(self_);
  // `lock` is destroyed before `self`, which may destroy the stream and its mutex.
}

void Stream::RunTask() {
  bool io_ok = false;
  {
    const std::lock_guard lock(mutex_);
    io_ok = io_ok_;
    // Wake-ups up to here are answered by this run; a later one sets it again.
    wake_ = false;
  }
  // Without the mutex: Work may block, and Wake, End and Cancelled must not wait for it.
  const Step step = Work(io_ok);
  const std::lock_guard lock(mutex_);
  if (step.next == Next::kEnd) {
    FinishLocked(step.status);
  } else if (ending_) {
    FinishLocked(end_status_);
  } else if (cancelled_) {
    FinishLocked(absl::CancelledError("the client is gone"));
  } else if (step.next == Next::kIo) {
    StartIoLocked();
  } else if (wake_) {
    SubmitLocked();
  } else {
    state_ = State::kIdle;
  }
}

void Stream::StartIoLocked() {
  state_ = State::kIo;
  io_since_ = absl::Now();
  StartIo();
}

void Stream::SubmitLocked() {
  state_ = State::kWorking;
  // The task holds the stream, so that Done() cannot destroy it while it waits in the queue.
  if (!pool_->SubmitAlways(project_, [self = shared_from_this()] { self->RunTask(); })) {
    FinishLocked(DrainingError());
  }
}

void Stream::FinishLocked(const absl::Status& status) {
  if (state_ == State::kFinished) return;
  state_ = State::kFinished;
  FinishCall(ToGrpc(status));
}

}  // namespace pepeseg
