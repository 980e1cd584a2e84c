#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "grpcpp/support/server_callback.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

class StreamRegistry;
struct StreamOwner;

// One streaming call: what all of them share. A stream is in one state at a time, under one mutex:
//
//   kWorking  its Work() is queued or running on the pool; there is never more than one
//   kIo       one message is being read or written: the bound of its queue is one
//   kIdle     waiting for Wake()
//   kFinished Finish was called, which happens exactly once, also on cancel
//
// A slow reader so costs one message: Work() is not called again before it was written. The stream
// owns itself until gRPC is done with it; tasks and wakers that come late hold their own reference.
class Stream : public std::enable_shared_from_this<Stream> {
 public:
  virtual ~Stream() = default;
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  // Once, right after construction: keeps the stream alive, registers it and has Work() called,
  // which finds out whether the caller may call before anything is read.
  void Begin();
  // Any thread, never blocks: Work() runs once more after this.
  void Wake();
  // As Wake(), but ends the stream if a read or write takes longer than io_limit().
  void Tick();
  // Ends the stream with `status` as soon as neither Work() nor a write is in flight.
  void End(const absl::Status& status);

 protected:
  enum class Next { kIo, kIdle, kEnd };
  // What to do after a Work(); `status` counts with kEnd.
  struct Step {
    Next next = Next::kIdle;
    absl::Status status;
  };

  Stream(StreamRegistry* registry, WorkerPool* pool) : registry_(registry), pool_(pool) {}

  // On a pool thread; may block. `io_ok`: the last message went through; false after a read: the
  // client has sent all it will.
  virtual Step Work(bool io_ok) = 0;
  // StartRead or StartWrite.
  virtual void StartIo() = 0;
  // Finish of the reactor.
  virtual void FinishCall(const grpc::Status& status) = 0;
  // A reaction, when gRPC is done with the call and before the stream's own reference is let go:
  // for what must not be destroyed by whoever holds the last one.
  virtual void OnClosed() {}
  // Whether Finish may be called with the message still on its way: true of reads.
  virtual bool may_finish_during_io() const = 0;
  // How long the read or write that is in progress may take; looked at every tick.
  virtual absl::Duration io_limit() const { return absl::InfiniteDuration(); }
  // Cancels the call, so that a write in progress ends: its client gets CANCELLED.
  virtual void CancelCall() {}

  // The caller of this stream is known: Work() calls it once, and ends with the error that it
  // returns (StreamRegistry::Admit).
  absl::Status Admit(const StreamOwner& owner);

  bool cancelled() const;

  // Reactions.
  void IoDone(bool ok);
  void Cancelled();
  void Done();  // may destroy the stream

 private:
  enum class State { kIdle, kWorking, kIo, kFinished };

  void Run();
  void StartIoLocked();
  void SubmitLocked();
  void FinishLocked(const absl::Status& status);

  StreamRegistry* const registry_;
  WorkerPool* const pool_;
  mutable std::mutex mutex_;
  State state_ = State::kIdle;
  bool io_ok_ = true;
  absl::Time io_since_ = absl::InfiniteFuture();  // in state kIo
  bool wake_ = false;                             // Wake() came while not idle
  bool ending_ = false;                           // end_status_ is to be sent
  bool cancelled_ = false;  // by the client, its deadline or a lost connection
  absl::Status end_status_;
  std::shared_ptr<Stream> self_;
};

template <typename Response>
class WriteStream : public grpc::ServerWriteReactor<Response>, public Stream {
 protected:
  using Stream::Stream;
  Response message_;  // filled by Work() before it answers kIo

 private:
  void StartIo() final { this->StartWrite(&message_); }
  void FinishCall(const grpc::Status& status) final { this->Finish(status); }
  bool may_finish_during_io() const final { return false; }
  void OnWriteDone(bool ok) final { IoDone(ok); }
  void OnCancel() final { Cancelled(); }
  void OnDone() final { Done(); }
};

template <typename Request>
class ReadStream : public grpc::ServerReadReactor<Request>, public Stream {
 protected:
  using Stream::Stream;
  Request message_;  // what was read; Work() answers kIo for the next one

 private:
  void StartIo() final { this->StartRead(&message_); }
  void FinishCall(const grpc::Status& status) final { this->Finish(status); }
  bool may_finish_during_io() const final { return true; }
  void OnReadDone(bool ok) final { IoDone(ok); }
  void OnCancel() final { Cancelled(); }
  void OnDone() final { Done(); }
};

// Reads and writes at once, for requests of which only the newest counts: one that comes while
// another waits takes its place. Work() takes what there is and answers kIo when `message_` is an
// answer, else kIdle; it is called again when a request has come.
template <typename Request, typename Response>
class NewestStream : public grpc::ServerBidiReactor<Request, Response>, public Stream {
 public:
  // Once, in place of Begin.
  void BeginReading() {
    Begin();
    const std::lock_guard lock(read_mutex_);
    if (!finished_) this->StartRead(&incoming_);
  }

 protected:
  using Stream::Stream;
  // None: wait, or end, when the client has sent all it will.
  std::optional<Request> TakeNewest() {
    const std::lock_guard lock(read_mutex_);
    return std::exchange(newest_, std::nullopt);
  }
  bool superseded() const {
    const std::lock_guard lock(read_mutex_);
    return newest_.has_value();
  }
  bool all_read() const {
    const std::lock_guard lock(read_mutex_);
    return all_read_ && !newest_;
  }
  Response message_;  // filled by Work() before it answers kIo

 private:
  void StartIo() final { this->StartWrite(&message_); }
  void FinishCall(const grpc::Status& status) final {
    const std::lock_guard lock(read_mutex_);  // no read is started after this
    finished_ = true;
    this->Finish(status);
  }
  bool may_finish_during_io() const final { return false; }
  void OnReadDone(bool ok) final {
    {
      const std::lock_guard lock(read_mutex_);
      all_read_ = !ok;
      if (ok) newest_ = std::move(incoming_);
      if (ok && !finished_) this->StartRead(&incoming_);
    }
    Wake();
  }
  void OnWriteDone(bool ok) final { IoDone(ok); }
  void OnCancel() final { Cancelled(); }
  void OnDone() final { Done(); }

  mutable std::mutex read_mutex_;  // taken after the stream's own
  Request incoming_;
  std::optional<Request> newest_;
  bool all_read_ = false;  // no further request will come
  bool finished_ = false;
};

}  // namespace pepeseg
