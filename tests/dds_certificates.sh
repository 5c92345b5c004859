#!/bin/sh
# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# dds_certificates.sh FOLDER NAME...: an authority in FOLDER, and for each NAME a folder FOLDER/NAME
# with what hap_link_dds_def.certificates has. Everything is encrypted, and nobody without a
# certificate of the authority may join. For tests: one authority for identities and permissions,
# valid for a day.
set -eu
folder=$1
shift
mkdir -p "$folder"
cd "$folder"
key() { openssl ecparam -name prime256v1 -genkey -noout -out "$1"; }
key ca_key.pem
openssl req -x509 -new -key ca_key.pem -days 2 -subj "/CN=hapode test authority" -out ca.pem
cat > governance.xml <<'END'
<?xml version="1.0" encoding="UTF-8"?>
<dds>
  <domain_access_rules>
    <domain_rule>
      <domains><id_range><min>0</min><max>230</max></id_range></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>NONE</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
END
sign() {
  openssl smime -sign -in "$1" -text -out "$2" -signer ca.pem -inkey ca_key.pem 2>/dev/null
}
sign governance.xml governance.p7s
for name in "$@"; do
  mkdir -p "$name"
  key "$name/key.pem"
  openssl req -new -key "$name/key.pem" -subj "/CN=$name" -out request.pem
  openssl x509 -req -in request.pem -CA ca.pem -CAkey ca_key.pem -CAcreateserial -days 1 \
    -out "$name/certificate.pem" 2>/dev/null
  cat > permissions.xml <<END
<?xml version="1.0" encoding="UTF-8"?>
<dds>
  <permissions>
    <grant name="$name">
      <subject_name>CN=$name</subject_name>
      <validity>
        <not_before>2020-01-01T00:00:00</not_before>
        <not_after>2050-01-01T00:00:00</not_after>
      </validity>
      <allow_rule>
        <domains><id_range><min>0</min><max>230</max></id_range></domains>
        <publish>
          <topics><topic>hapode_1_*</topic></topics>
          <partitions><partition>*</partition></partitions>
        </publish>
        <subscribe>
          <topics><topic>hapode_1_*</topic></topics>
          <partitions><partition>*</partition></partitions>
        </subscribe>
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
END
  sign permissions.xml "$name/permissions.p7s"
  cp governance.p7s "$name/governance.p7s"
  cp ca.pem "$name/identity_ca.pem"
  cp ca.pem "$name/permissions_ca.pem"
done
