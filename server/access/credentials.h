#pragma once

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>

#include <condition_variable>
#include <ctime>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/access_options.h"

namespace pepeseg {

// A text that other code of this process can read as a file, though it is never on a disk. Replace
// is atomic: a reader that opens the file sees the old text or the new one. Each text has its own
// modification time, in seconds, so that a reader who compares it before and after reading notices
// a change.
class MemoryFile {
 public:
  MemoryFile() = default;
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  // INTERNAL: the system has no memory or no descriptor left; the old text stays.
  absl::Status Replace(const std::string& text);
  // Returns the path, which stays the same for all texts. Valid after the first Replace.
  std::string path() const;

 private:
  int descriptor_ = -1;
  time_t next_time_ = 1'000'000'000;  // modification time of the next text; any start but 0
};

// TLS credentials of the listeners. A thread reads the files again every second. A certificate and
// key that belong together are used for connections made from then on; anything else is logged and
// changes nothing.
//
// gRPC's own file watcher would load whatever the files contain, and a key that does not fit the
// certificate breaks it. So it watches copies in memory, where chain and key are one file and are
// replaced in one step.
class ListenerCredentials {
 public:
  // Returns the errors of ReadCertificateFiles. Without a certificate: no encryption.
  static absl::StatusOr<std::unique_ptr<ListenerCredentials>> Open(const AccessOptions& options);
  ~ListenerCredentials();
  ListenerCredentials(const ListenerCredentials&) = delete;
  ListenerCredentials& operator=(const ListenerCredentials&) = delete;

  // Returns credentials for one listener.
  std::shared_ptr<grpc::ServerCredentials> Make() const;

 private:
  explicit ListenerCredentials(AccessOptions options) : options_(std::move(options)) {}
  // Reads the files, and publishes them if they have changed.
  absl::Status Load();
  // Replaces the copies in memory.
  absl::Status Publish(const CertificateTexts& texts);
  void Watch();

  const AccessOptions options_;
  CertificateTexts texts_;  // those in use
  MemoryFile pair_;         // key and chain in one file, so that one step replaces both
  MemoryFile client_ca_;
  std::shared_ptr<grpc::experimental::FileWatcherCertificateProvider> provider_;
  mutable std::mutex mutex_;  // guards texts_ and stopping_
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
