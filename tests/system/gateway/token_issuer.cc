#include "tests/system/gateway/token_issuer.h"

#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace pepeseg::testing {
namespace {

constexpr char kHeader[] = R"({"alg":"RS256","typ":"JWT"})";

std::string SignedPart(const std::string& header, const std::string& payload) {
  return absl::StrCat(absl::WebSafeBase64Escape(header), ".", absl::WebSafeBase64Escape(payload));
}

}  // namespace

TokenIssuer::TokenIssuer() : key_(EVP_RSA_gen(2048)) {
  BIO* bio = BIO_new(BIO_s_mem());
  EXPECT_EQ(PEM_write_bio_PUBKEY(bio, key_.get()), 1);
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(bio, &bytes);
  public_key_.assign(bytes, static_cast<size_t>(size));
  BIO_free(bio);
}

nlohmann::json TokenIssuer::Claims(const std::string& project, const std::string& scope) {
  return {{"iss", kIssuer},           {"aud", kAudience},
          {"sub", "ann@example.org"}, {"exp", absl::ToUnixSeconds(absl::Now()) + 600},
          {"project", project},       {"scope", scope}};
}

std::string TokenIssuer::Signature(const std::string& header, const std::string& payload) const {
  const std::string text = SignedPart(header, payload);
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  EVP_DigestSignInit(context, nullptr, EVP_sha256(), nullptr, key_.get());
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  size_t size = 0;
  EVP_DigestSign(context, nullptr, &size, bytes, text.size());
  std::string signature(size, '\0');
  EXPECT_EQ(EVP_DigestSign(context, reinterpret_cast<unsigned char*>(signature.data()), &size,
                           bytes, text.size()),
            1);
  EVP_MD_CTX_free(context);
  signature.resize(size);
  return signature;
}

std::string TokenIssuer::Assemble(const std::string& header, const std::string& payload,
                                  const std::string& signature) {
  return absl::StrCat(SignedPart(header, payload), ".", absl::WebSafeBase64Escape(signature));
}

std::string TokenIssuer::Sign(const nlohmann::json& claims) const {
  const std::string payload = claims.dump();
  return Assemble(kHeader, payload, Signature(kHeader, payload));
}

}  // namespace pepeseg::testing
