#pragma once

#include <openssl/evp.h>
#include <openssl/x509.h>

#include <memory>
#include <string>

namespace pepeseg::testing {

// A certificate and its key, in PEM.
struct IssuedCertificate {
  std::string certificate;
  std::string key;
};

// A certificate authority for one run of a test: elliptic keys, valid for an hour.
class TestAuthority {
 public:
  explicit TestAuthority(const std::string& name);

  const std::string& certificate() const { return own_.certificate; }
  // Issues a certificate for "localhost", 127.0.0.1 and ::1, for a server or a client.
  IssuedCertificate Issue(const std::string& name);

 private:
  struct Free {
    void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
    void operator()(X509* certificate) const { X509_free(certificate); }
  };
  std::unique_ptr<EVP_PKEY, Free> key_;
  std::unique_ptr<X509, Free> root_;
  IssuedCertificate own_;
  int next_serial_ = 2;
};

}  // namespace pepeseg::testing
