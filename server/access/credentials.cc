#include "server/access/credentials.h"

#include <fcntl.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <spdlog/spdlog.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr std::chrono::seconds kPause{1};
constexpr unsigned int kProviderSeconds = 1;  // the shortest interval that gRPC allows

absl::Status SystemError(const char* what) {
  return absl::InternalError(absl::StrCat("file in memory: ", what, ": ", std::strerror(errno)));
}

}  // namespace

MemoryFile::~MemoryFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

// Writes the text to a new memory file, and then makes the old descriptor refer to it. Readers open
// /proc/self/fd/N, so those who have opened it before keep the old text.
absl::Status MemoryFile::Replace(const std::string& text) {
  const int made = memfd_create("pepeseg-tls", MFD_CLOEXEC);
  if (made < 0) return SystemError("cannot make it");
  // The provider looks at the time of modification: a new text needs a later one, even within the
  // same second.
  const timespec time = {next_time_, 0};
  const std::array<timespec, 2> times = {time, time};
  absl::Status status;
  if (write(made, text.data(), text.size()) != static_cast<ssize_t>(text.size()) ||
      futimens(made, times.data()) != 0) {
    status = SystemError("cannot write it");
  } else if (descriptor_ < 0) {
    descriptor_ = made;
  } else if (dup3(made, descriptor_, O_CLOEXEC) < 0) {  // atomic for readers of path()
    status = SystemError("cannot replace it");
  }
  // After dup3 the old number refers to the new file.
  if (made != descriptor_) close(made);
  if (status.ok()) ++next_time_;
  return status;
}

std::string MemoryFile::path() const { return absl::StrCat("/proc/self/fd/", descriptor_); }

absl::StatusOr<std::unique_ptr<ListenerCredentials>> ListenerCredentials::Open(
    const AccessOptions& options) {
  RETURN_IF_ERROR(CheckCertificateOptions(options));
  auto credentials = std::unique_ptr<ListenerCredentials>(new ListenerCredentials(options));
  if (options.tls_certificate.empty()) return credentials;
  RETURN_IF_ERROR(credentials->Load());
  const std::string pair = credentials->pair_.path();
  const std::string client_ca = options.tls_client_ca.empty() ? "" : credentials->client_ca_.path();
  credentials->provider_ = std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
      pair, pair, client_ca, kProviderSeconds);
  credentials->thread_ = std::thread([self = credentials.get()] { self->Watch(); });
  return credentials;
}

ListenerCredentials::~ListenerCredentials() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<grpc::ServerCredentials> ListenerCredentials::Make() const {
  if (provider_ == nullptr) return grpc::InsecureServerCredentials();
  grpc::experimental::TlsServerCredentialsOptions options(provider_);
  options.watch_identity_key_cert_pairs();
  if (!options_.tls_client_ca.empty()) {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

absl::Status ListenerCredentials::Load() {
  ASSIGN_OR_RETURN(CertificateTexts texts, ReadCertificateFiles(options_));
  if (texts == texts_) return absl::OkStatus();
  RETURN_IF_ERROR(Publish(texts));
  texts_ = std::move(texts);
  spdlog::info("TLS: {} is in use", options_.tls_certificate.string());
  return absl::OkStatus();
}

absl::Status ListenerCredentials::Publish(const CertificateTexts& texts) {
  if (texts.chain != texts_.chain || texts.key != texts_.key) {
    // Key and chain are in one file, so that the provider never reads halves of two pairs.
    RETURN_IF_ERROR(pair_.Replace(texts.key + "\n" + texts.chain));
  }
  if (texts.client_ca.empty() || texts.client_ca == texts_.client_ca) return absl::OkStatus();
  return client_ca_.Replace(texts.client_ca);
}

void ListenerCredentials::Watch() {
  std::string logged;  // the last error, so that a bad file is logged once
  std::unique_lock lock(mutex_);
  while (!stop_.wait_for(lock, kPause, [this] { return stopping_; })) {
    // Under the mutex, which guards texts_; readers wait for the files at most once a second.
    const absl::Status status = Load();
    std::string message(status.message());
    if (!status.ok() && message != logged) {
      spdlog::error("TLS: {}: the certificate that is in use stays", message);
    }
    logged = std::move(message);
  }
}

}  // namespace pepeseg
