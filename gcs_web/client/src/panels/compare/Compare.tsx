/** The compare step: the flights beside plan and model. On a phone the list stands in the sheet. */

import { comparison } from "../../core/store";
import { phone } from "../../core/theme";
import { FlightDrawer } from "./FlightDrawer";
import { FlightList } from "./FlightList";
import { SaveReport } from "./SaveReport";
import { WhereItFails } from "./WhereItFails";

export function Compare() {
  const found = comparison.value;
  return (
    <>
      {phone.value && <FlightList />}
      {phone.value && <FlightDrawer />}
      <WhereItFails />
      {found !== null && found.state !== "none" && <SaveReport of="comparison" made={found.has_report} />}
    </>
  );
}
