"""What a report needs from outside its document: pictures, the settings' names, and WeasyPrint for PDF."""
