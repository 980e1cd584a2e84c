#pragma once

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>

#include <condition_variable>
#include <ctime>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/access_options.h"

namespace pepeseg {

// A text that code of this process reads as a file while it never comes to a disk. A reader sees
// one text or the other, never some of both; and each has a time of modification of its own, in
// seconds, so that who looks at that before and after reading knows.
class MemoryFile {
 public:
  MemoryFile() = default;
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  // INTERNAL: the system has no memory or no descriptor for it; the old text stays.
  absl::Status Replace(const std::string& text);
  // The same for all its texts; once there is one.
  std::string path() const;

 private:
  int descriptor_ = -1;
  time_t next_time_ = 1'000'000'000;  // any, but not 0
};

// What listeners encrypt with. The files are read again every second; what is whole and fits goes
// to connections made from then on, anything else is told in the log and changes nothing. (gRPC's
// own watch takes whatever stands in the files, and a key beside another's certificate breaks it:
// so it watches copies in memory, which are swapped both in one step.)
class ListenerCredentials {
 public:
  // FAILED_PRECONDITION: as ReadCertificateFiles. Without a certificate: no encryption.
  static absl::StatusOr<std::unique_ptr<ListenerCredentials>> Open(const AccessOptions& options);
  ~ListenerCredentials();
  ListenerCredentials(const ListenerCredentials&) = delete;
  ListenerCredentials& operator=(const ListenerCredentials&) = delete;

  // For one listener.
  std::shared_ptr<grpc::ServerCredentials> Make() const;
  // Those in use; none: no encryption.
  std::optional<CertificateTexts> texts() const;

 private:
  explicit ListenerCredentials(AccessOptions options) : options_(std::move(options)) {}
  absl::Status Load();
  absl::Status Publish(const CertificateTexts& texts);
  void Watch();

  const AccessOptions options_;
  CertificateTexts texts_;  // those in use
  MemoryFile pair_;         // chain and key in one, so that they are swapped in one step
  MemoryFile client_ca_;
  std::shared_ptr<grpc::experimental::FileWatcherCertificateProvider> provider_;
  mutable std::mutex mutex_;  // guards texts_ and stopping_
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
