#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "grpcpp/support/server_callback.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

class StreamRegistry;
struct StreamOwner;

// The part of a streaming call that does not depend on its messages. A stream is in one state at a
// time, which its mutex guards:
//
//   kWorking  its Work() is queued or running on the pool; there is never more than one
//   kIo       one message is being read or written; there is never more than one
//   kIdle     waiting for Wake()
//   kFinished Finish was called, which happens exactly once, also on cancel
//
// A slow reader costs the memory of one message: Work() is not called again before the message was
// written. The stream owns itself until gRPC is done with it (OnDone); tasks and wakers that come
// later hold their own reference.
class Stream : public std::enable_shared_from_this<Stream> {
 public:
  virtual ~Stream() = default;
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  // Keeps the stream alive, registers it and queues Work(), which authorises the caller before
  // anything is read. Call once, right after construction.
  void Begin();
  // Makes Work() run again after this call. Any thread; never blocks.
  void Wake();
  // Ends the stream if a read or write takes longer than io_limit(); else calls Wake().
  void Tick();
  // Ends the stream with `status` as soon as neither Work() nor a write is in flight.
  void End(const absl::Status& status);

 protected:
  enum class Next { kIo, kIdle, kEnd };
  // What to do after Work(), and the status of the call if `next` is kEnd. Work that takes long
  // calls Wake() and returns kIdle after each part, so that other projects have their turns.
  struct Step {
    Next next = Next::kIdle;
    absl::Status status;
  };

  Stream(StreamRegistry* registry, WorkerPool* pool) : registry_(registry), pool_(pool) {}

  // Does the next piece of work, on a pool thread; may block. `io_ok`: the last message was read or
  // written. False after a read: the client has sent all its messages.
  virtual Step Work(bool io_ok) = 0;
  // Calls StartRead or StartWrite of the reactor.
  virtual void StartIo() = 0;
  // Calls Finish of the reactor.
  virtual void FinishCall(const grpc::Status& status) = 0;
  // Called in a reaction when gRPC is done with the call, before the stream drops its reference to
  // itself. Releases what must not be destroyed on the thread that drops the last reference.
  virtual void OnClosed() {}
  // Returns whether Finish may be called while a message is in progress: true for reads.
  virtual bool may_finish_during_io() const = 0;
  // Returns how long the read or write in progress may take. Checked at every tick.
  virtual absl::Duration io_limit() const { return absl::InfiniteDuration(); }
  // Cancels the call, so that a write in progress ends; the client gets CANCELLED.
  virtual void CancelCall() {}

  // Counts the stream for its owner (StreamRegistry::Admit). Work() calls it once, when the caller
  // is known, and ends the stream with the error that it returns.
  absl::Status Admit(const StreamOwner& owner);

  bool cancelled() const;

  // Reactions of gRPC, which must not block.
  void IoDone(bool ok);
  void Cancelled();
  void Done();  // may destroy the stream

 private:
  enum class State { kIdle, kWorking, kIo, kFinished };

  // One task of the pool: calls Work() and acts on its answer.
  void RunTask();
  void StartIoLocked();
  void SubmitLocked();
  void FinishLocked(const absl::Status& status);

  StreamRegistry* const registry_;
  WorkerPool* const pool_;
  mutable std::mutex mutex_;
  State state_ = State::kIdle;
  bool io_ok_ = true;
  absl::Time io_since_ = absl::InfiniteFuture();  // in state kIo
  bool wake_ = false;                             // Wake() was called while not idle
  bool ending_ = false;                           // end_status_ is to be sent
  bool cancelled_ = false;  // by the client, its deadline or a lost connection
  absl::Status end_status_;
  std::string project_;  // owner of its tasks, once Admit has been called
  std::shared_ptr<Stream> self_;
};

template <typename Response>
class WriteStream : public grpc::ServerWriteReactor<Response>, public Stream {
 protected:
  using Stream::Stream;
  Response message_;  // filled by Work() before it returns kIo

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
  Request message_;  // the message that was read; Work() returns kIo to read the next one

 private:
  void StartIo() final { this->StartRead(&message_); }
  void FinishCall(const grpc::Status& status) final { this->Finish(status); }
  bool may_finish_during_io() const final { return true; }
  void OnReadDone(bool ok) final { IoDone(ok); }
  void OnCancel() final { Cancelled(); }
  void OnDone() final { Done(); }
};

// A stream that reads and writes at the same time, of whose requests only the newest counts: a
// request replaces one that still waits. Work() takes the newest request and returns kIo if
// `message_` is an answer, else kIdle; it is called again when a request comes.
template <typename Request, typename Response>
class NewestStream : public grpc::ServerBidiReactor<Request, Response>, public Stream {
 public:
  // Begins the stream and starts to read. Call once, instead of Begin.
  void BeginReading() {
    Begin();
    const std::lock_guard lock(read_mutex_);
    if (!finished_) this->StartRead(&incoming_);
  }

 protected:
  using Stream::Stream;
  // Returns the newest request, or nullopt if none waits: see all_read().
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
  Response message_;  // filled by Work() before it returns kIo

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
  bool all_read_ = false;  // the client has sent its last request
  bool finished_ = false;
};

}  // namespace pepeseg
