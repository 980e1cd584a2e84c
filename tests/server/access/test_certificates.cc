#include "tests/server/access/test_certificates.h"

#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

namespace pepeseg::testing {
namespace {

constexpr long kMarginSeconds = 3600;

EVP_PKEY* MakeEllipticKey() {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  EXPECT_NE(key, nullptr);
  return key;
}

X509* MakeUnsigned(const std::string& name, EVP_PKEY* key, int serial) {
  X509* certificate = X509_new();
  X509_set_version(certificate, X509_VERSION_3);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate), serial);
  X509_gmtime_adj(X509_getm_notBefore(certificate), -kMarginSeconds);
  X509_gmtime_adj(X509_getm_notAfter(certificate), kMarginSeconds);
  X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  X509_set_pubkey(certificate, key);
  return certificate;
}

void AddExtension(X509* certificate, int kind, const char* value) {
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, nullptr, kind, value);
  ASSERT_NE(extension, nullptr) << value;
  X509_add_ext(certificate, extension, -1);
  X509_EXTENSION_free(extension);
}

std::string TextOf(BIO* bio) {
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(bio, &bytes);
  std::string text(bytes, static_cast<size_t>(size));
  BIO_free(bio);
  return text;
}

IssuedCertificate ToPem(X509* certificate, EVP_PKEY* key) {
  BIO* certificate_bio = BIO_new(BIO_s_mem());
  PEM_write_bio_X509(certificate_bio, certificate);
  BIO* key_bio = BIO_new(BIO_s_mem());
  PEM_write_bio_PrivateKey(key_bio, key, nullptr, nullptr, 0, nullptr, nullptr);
  return {TextOf(certificate_bio), TextOf(key_bio)};
}

}  // namespace

TestAuthority::TestAuthority(const std::string& name)
    : key_(MakeEllipticKey()), root_(MakeUnsigned(name, key_.get(), 1)) {
  X509_set_issuer_name(root_.get(), X509_get_subject_name(root_.get()));
  AddExtension(root_.get(), NID_basic_constraints, "critical,CA:TRUE");
  AddExtension(root_.get(), NID_key_usage, "critical,keyCertSign");
  EXPECT_GT(X509_sign(root_.get(), key_.get(), EVP_sha256()), 0);
  own_ = ToPem(root_.get(), key_.get());
}

IssuedCertificate TestAuthority::Issue(const std::string& name) {
  const std::unique_ptr<EVP_PKEY, Free> key(MakeEllipticKey());
  const std::unique_ptr<X509, Free> certificate(MakeUnsigned(name, key.get(), next_serial_++));
  X509_set_issuer_name(certificate.get(), X509_get_subject_name(root_.get()));
  AddExtension(certificate.get(), NID_subject_alt_name,
               "DNS:localhost,IP:127.0.0.1,IP:0:0:0:0:0:0:0:1");
  EXPECT_GT(X509_sign(certificate.get(), key_.get(), EVP_sha256()), 0);
  return ToPem(certificate.get(), key.get());
}

}  // namespace pepeseg::testing
