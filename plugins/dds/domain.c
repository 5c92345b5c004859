/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "domain.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CONFIG_MOST 4096
#define PATH_MOST 4096

/* A client that dies is missed after so long. */
#define LEASE "3s"

hap_status link_fail(hap_detail *detail, hap_status status, const char *format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(detail->text, sizeof detail->text, format, arguments);
  va_end(arguments);
  return status;
}

/* ---- settings: as text, which DDS reads ---- */

/* Appends; what does not fit ends the text, and DDS refuses what is left. */
static void config_add(char *config, const char *format, ...) HAP_PRINTF(2, 3);
static void config_add(char *config, const char *format, ...)
{
  size_t length = strlen(config);
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(config + length, CONFIG_MOST - length, format, arguments);
  va_end(arguments);
}

static void config_add_peers(char *config, const char *peers)
{
  for (const char *at = peers; *at != '\0';) {
    size_t length = strcspn(at, ",");
    if (length > 0) {
      config_add(config, "<Peer Address=\"%.*s\"/>", (int)length, at);
    }
    at += length + (at[length] == ',');
  }
}

/* Texts hold no letter that XML would read otherwise: the library has checked them. */
static void config_write(const hap_link_dds_def *def, char config[CONFIG_MOST])
{
  bool alone = def->certificates == NULL && def->insecure == 0;
  bool multicast = !alone && def->peers == NULL;
  config[0] = '\0';
  config_add(config, "<CycloneDDS><Domain Id=\"any\"><General><Interfaces>");
  if (alone) {
    config_add(config, "<NetworkInterface address=\"127.0.0.1\" multicast=\"false\"/>");
  } else if (def->interface_name != NULL) {
    bool address = strspn(def->interface_name, "0123456789.:") == strlen(def->interface_name);
    config_add(config, "<NetworkInterface %s=\"%s\"/>", address ? "address" : "name",
               def->interface_name);
  } else {
    config_add(config, "<NetworkInterface autodetermine=\"true\"/>");
  }
  config_add(config,
             "</Interfaces><AllowMulticast>%s</AllowMulticast><MaxMessageSize>1400B"
             "</MaxMessageSize><FragmentSize>1320B</FragmentSize></General><Discovery>"
             "<LeaseDuration>" LEASE "</LeaseDuration>",
             multicast ? "true" : "false");
  if (!multicast) { /* those who are asked have ports that can be guessed */
    config_add(config,
               "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>31"
               "</MaxAutoParticipantIndex><Peers>");
    config_add_peers(config, alone ? "127.0.0.1" : def->peers);
    config_add(config, "</Peers>");
  }
  config_add(config, "</Discovery></Domain></CycloneDDS>");
}

/* ---- domains of this process, which has each of them once ---- */

#define DOMAINS_MOST 8

typedef struct open_domain {
  uint32_t id;
  uint32_t links; /* 0: not in use */
  dds_entity_t handle;
  char config[CONFIG_MOST];
} open_domain;

static pthread_mutex_t domains_lock = PTHREAD_MUTEX_INITIALIZER;
static open_domain domains[DOMAINS_MOST];

/* ---- what DDS says of itself, of all domains of the process ---- */

static void (*domains_say)(uint32_t error, const char *text);

static void log_take(void *of, const dds_log_data_t *data)
{
  char text[512];
  (void)of;
  (void)snprintf(text, sizeof text, "%.*s", (int)strcspn(data->message, "\n"), data->message);
  if (domains_say != NULL &&
      (data->priority & (DDS_LC_FATAL | DDS_LC_ERROR | DDS_LC_WARNING)) != 0) {
    domains_say((data->priority & DDS_LC_WARNING) == 0, text);
  }
}

void link_domain_listen(void (*say)(uint32_t error, const char *text))
{
  pthread_mutex_lock(&domains_lock);
  if (say != domains_say) { /* once: threads of DDS read it without the lock */
    domains_say = say;
    dds_set_log_sink(say != NULL ? log_take : NULL, NULL);
  }
  pthread_mutex_unlock(&domains_lock);
}

/* ---- domains ---- */

/* That of the id, or a free one; NULL: neither. */
static open_domain *domain_at(uint32_t id)
{
  open_domain *free_one = NULL;
  for (int i = 0; i < DOMAINS_MOST; ++i) {
    if (domains[i].links > 0 && domains[i].id == id) {
      return &domains[i];
    }
    free_one = domains[i].links == 0 ? &domains[i] : free_one;
  }
  return free_one;
}

static hap_status domain_take(uint32_t id, const char *config, hap_detail *detail)
{
  open_domain *domain = domain_at(id);
  if (domain == NULL) {
    return link_fail(detail, HAP_ERROR_CAPACITY, "the process has links in %d DDS domains already",
                     DOMAINS_MOST);
  }
  if (domain->links > 0) {
    if (strcmp(domain->config, config) != 0) {
      return link_fail(detail, HAP_ERROR_STATE,
                       "the process has a link in DDS domain %u with another network: use another "
                       "domain",
                       id);
    }
    ++domain->links;
    return HAP_OK;
  }
  dds_entity_t handle = dds_create_domain(id, config);
  if (handle == DDS_RETCODE_PRECONDITION_NOT_MET) {
    return link_fail(detail, HAP_ERROR_STATE,
                     "the process has DDS domain %u for something else: use another domain", id);
  }
  if (handle < 0) {
    return link_fail(detail, HAP_ERROR_IO,
                     "DDS domain %u: %s; is the network interface there, and up?", id,
                     dds_strretcode(handle));
  }
  *domain = (open_domain){.id = id, .links = 1, .handle = handle};
  (void)snprintf(domain->config, sizeof domain->config, "%s", config);
  return HAP_OK;
}

static void domain_give(uint32_t id)
{
  open_domain *domain = domain_at(id);
  if (domain != NULL && domain->links > 0 && --domain->links == 0) {
    (void)dds_delete(domain->handle);
  }
}

/* ---- certificates ---- */

typedef struct security_part {
  const char *property;
  const char *file;
} security_part;

static const security_part parts[] = {
    {"dds.sec.auth.identity_ca", "identity_ca.pem"},
    {"dds.sec.auth.identity_certificate", "certificate.pem"},
    {"dds.sec.auth.private_key", "key.pem"},
    {"dds.sec.access.permissions_ca", "permissions_ca.pem"},
    {"dds.sec.access.governance", "governance.p7s"},
    {"dds.sec.access.permissions", "permissions.p7s"},
};

static const security_part plugins[] = {
    {"dds.sec.auth.library", "auth"},
    {"dds.sec.access.library", "ac"},
    {"dds.sec.crypto.library", "crypto"},
};

static const char *const inits[][2] = {
    {"init_authentication", "finalize_authentication"},
    {"init_access_control", "finalize_access_control"},
    {"init_crypto", "finalize_crypto"},
};

/* Of an installation that keeps them apart, and of one that does not. */
static bool plugin_find(const char *name, char out[PATH_MOST])
{
  static const char *const folders[] = {"libddsc0debian/", ""};
  Dl_info info;
  char own[PATH_MOST];
  void *symbol = NULL;
  dds_entity_t (*function)(dds_domainid_t, const char *) = dds_create_domain;
  memcpy(&symbol, &function, sizeof symbol);
  if (dladdr(symbol, &info) == 0 || realpath(info.dli_fname, own) == NULL) {
    return false;
  }
  *(strrchr(own, '/') + 1) = '\0';
  for (int i = 0; i < 2; ++i) {
    char path[2 * PATH_MOST];
    (void)snprintf(path, sizeof path, "%s%slibdds_security_%s.so", own, folders[i], name);
    if (access(path, R_OK) == 0 && realpath(path, out) != NULL) {
      return true;
    }
  }
  return false;
}

static hap_status security_set(const char *folder, dds_qos_t *qos, hap_detail *detail)
{
  char path[PATH_MOST];
  char value[PATH_MOST + 8];
  char name[80];
  for (size_t i = 0; i < sizeof parts / sizeof parts[0]; ++i) {
    (void)snprintf(path, sizeof path, "%s/%s", folder, parts[i].file);
    if (access(path, R_OK) != 0) {
      return link_fail(detail, HAP_ERROR_NOT_FOUND,
                       "%.300s cannot be read: the folder has identity_ca.pem, certificate.pem, "
                       "key.pem, permissions_ca.pem, governance.p7s, permissions.p7s",
                       path);
    }
    (void)snprintf(value, sizeof value, "file:%s", path);
    dds_qset_prop(qos, parts[i].property, value);
  }
  for (size_t i = 0; i < sizeof plugins / sizeof plugins[0]; ++i) {
    if (!plugin_find(plugins[i].file, path)) {
      return link_fail(detail, HAP_ERROR_UNSUPPORTED,
                       "this installation of Cyclone DDS has no security: libdds_security_%s.so is "
                       "missing (Debian: libddsc0debian)",
                       plugins[i].file);
    }
    (void)snprintf(name, sizeof name, "%s.path", plugins[i].property);
    dds_qset_prop(qos, name, path);
    (void)snprintf(name, sizeof name, "%s.init", plugins[i].property);
    dds_qset_prop(qos, name, inits[i][0]);
    (void)snprintf(name, sizeof name, "%s.finalize", plugins[i].property);
    dds_qset_prop(qos, name, inits[i][1]);
  }
  return HAP_OK;
}

/* ---- participants ---- */

static hap_status participant_make(const hap_link_dds_def *def, dds_entity_t *out,
                                   hap_detail *detail)
{
  dds_qos_t *qos = dds_create_qos();
  hap_status status =
      def->certificates != NULL ? security_set(def->certificates, qos, detail) : HAP_OK;
  if (status >= HAP_OK) {
    *out = dds_create_participant(def->domain, qos, NULL);
    if (*out < 0 && def->certificates != NULL) {
      status = link_fail(detail, HAP_ERROR_IO,
                         "DDS does not take the certificates of %.300s: %s; are they of one "
                         "authority, and valid today?",
                         def->certificates, dds_strretcode(*out));
    } else if (*out < 0) {
      status = link_fail(detail, HAP_ERROR_IO, "DDS: %s", dds_strretcode(*out));
    }
  }
  dds_delete_qos(qos);
  return status;
}

hap_status link_domain_join(const hap_link_dds_def *def, dds_entity_t *out_participant,
                            hap_detail *detail)
{
  char config[CONFIG_MOST];
  config_write(def, config);
  pthread_mutex_lock(&domains_lock);
  hap_status status = domain_take(def->domain, config, detail);
  if (status >= HAP_OK) {
    status = participant_make(def, out_participant, detail);
    if (status < HAP_OK) {
      domain_give(def->domain);
    }
  }
  pthread_mutex_unlock(&domains_lock);
  return status;
}

void link_domain_leave(uint32_t domain, dds_entity_t participant)
{
  pthread_mutex_lock(&domains_lock);
  (void)dds_delete(participant);
  domain_give(domain);
  pthread_mutex_unlock(&domains_lock);
}
