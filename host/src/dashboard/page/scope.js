// The live stream: smallest and largest value of each channel in each short stretch, the newest at
// the right edge.
const scope={capacity:4096,length:0,next:0,first:null,end:0,missed:0,span:4,channels:0,late:[],received:0,drawn:0,pending:null};
const NOTHING=[32767,-32768];
function roomFor(channels){
  Object.assign(scope,{channels,length:0,next:0,first:new Float64Array(scope.capacity),scans:new Float64Array(scope.capacity),codes:new Int16Array(2*scope.capacity*channels),end:0});
}
// a frame with the layout in live/frames.rs; other kinds and versions are ignored
function takeFrame(v){
  if(v.byteLength<32||v.getUint8(0)!==1||v.getUint8(1)!==1)return;
  const channels=v.getUint16(2,true),stretches=v.getUint32(4,true),first=Number(v.getBigUint64(8,true)),per=v.getUint32(16,true);
  if(channels!==scope.channels||first<scope.end)roomFor(channels);
  const missed=v.getUint32(20,true);
  scope.received++;scope.pending=v.getFloat64(24,true);
  if(missed!==scope.missed){scope.missed=missed;tell('link')}
  const codes=new Int16Array(v.buffer,32);
  for(let s=0;s<stretches;s++){
    const at=scope.next;
    scope.first[at]=first+s*per;scope.scans[at]=per;
    scope.codes.set(codes.subarray(2*channels*s,2*channels*(s+1)),2*channels*at);
    scope.next=(at+1)%scope.capacity;scope.length=Math.min(scope.length+1,scope.capacity);
  }
  scope.end=first+stretches*per;
  if(screen?.key==='scope')drawScope();
}
onFrame(takeFrame);
let scopeDue=false;
function drawScope(){
  if(scopeDue||held||document.hidden)return;
  scopeDue=true;
  requestAnimationFrame(()=>{scopeDue=false;paintScope()});
}
// an SI value with a suitable prefix
function inUnit(v,unit){
  if(!Number.isFinite(v))return'–';
  const a=Math.abs(v),[by,prefix]=a>=1e3?[1e-3,'k']:a>=1||a===0?[1,'']:a>=1e-3?[1e3,'m']:a>=1e-6?[1e6,'µ']:[1e9,'n'];
  return(v*by).toPrecision(3)+' '+prefix+unit;
}
function paintScope(){
  const rows=SCREENS.find(s=>s.key==='scope').rows,stream=state.whole?.now.stream;
  if(!rows||!stream||rows.length!==scope.channels)return;
  const shown=scope.span*stream.rate_hz,from=scope.end-shown,line=css('--r-group-1'),grid=css('--grid'),gone=css('--r-unusable'),lost=css('--r-refused');
  rows.forEach((row,c)=>{
    const canvas=row.canvas,ratio=devicePixelRatio||1,w=canvas.clientWidth,h=canvas.clientHeight;
    if(!w)return;
    if(canvas.width!==Math.round(w*ratio)||canvas.height!==Math.round(h*ratio)){canvas.width=Math.round(w*ratio);canvas.height=Math.round(h*ratio)}
    const g=canvas.getContext('2d');
    g.setTransform(ratio,0,0,ratio,0,0);g.clearRect(0,0,w,h);
    // smallest and largest value of each column of pixels
    const low=new Float64Array(w).fill(Infinity),high=new Float64Array(w).fill(-Infinity),column=n=>Math.floor((n-from)/shown*w);
    let most=16,before=null;
    const holes=[];
    for(let i=0;i<scope.length;i++){
      const at=(scope.next-scope.length+i+scope.capacity)%scope.capacity,first=scope.first[at],end=first+scope.scans[at];
      if(before!==null&&first>before)holes.push([before,first,gone]);
      before=end;
      if(end<=from)continue;
      const l=scope.codes[2*(at*scope.channels+c)],u=scope.codes[2*(at*scope.channels+c)+1];
      if(l>u){holes.push([first,end,lost]);continue}
      most=Math.max(most,-l,u);
      for(let x=Math.max(0,column(first));x<=Math.min(w-1,Math.max(column(end)-1,column(first)));x++){low[x]=Math.min(low[x],l);high[x]=Math.max(high[x],u)}
    }
    for(const[a,b,colour]of holes){g.fillStyle=colour;g.globalAlpha=.35;g.fillRect(column(Math.max(a,from)),0,Math.max(1,column(b)-column(Math.max(a,from))),h);g.globalAlpha=1}
    // the scale grows with the signal immediately; it shrinks only above four times the peak
    if(!(row.scale>=most)||row.scale>4*most)row.scale=Math.min(32768,1.25*most);
    const factor=stream.channels[c].units_per_code,up=Math.sign(factor)||1,y=code=>h/2-up*code/row.scale*(h/2-2);
    g.strokeStyle=grid;g.beginPath();g.moveTo(0,h/2);g.lineTo(w,h/2);g.stroke();
    g.fillStyle=line;
    for(let x=0;x<w;x++)if(low[x]<=high[x]){const a=y(low[x]),b=y(high[x]);g.fillRect(x,Math.min(a,b)-.5,1,Math.abs(a-b)+1)}
    row.range.textContent='±'+inUnit(Math.abs(factor)*row.scale,stream.channels[c].unit);
  });
  scope.drawn++;
  if(scope.pending!==null){scope.late.push(Date.now()-scope.pending);if(scope.late.length>600)scope.late.shift();scope.pending=null}
}
function scopeNumbers(rows){
  const s=state.whole.now.signals,stream=state.whole.now.stream;
  if(!s||!stream||s.rms.length!==rows.length)return;
  rows.forEach((row,c)=>{
    const at=s.overload_unix_ms[c],peak=s.peak_codes[c],headroom=peak?20*Math.log10(32768/peak):Infinity;
    row.numbers.textContent=`rms ${inUnit(s.rms[c],stream.channels[c].unit)}, headroom ${Number.isFinite(headroom)?headroom.toFixed(0)+' dB':'–'}`;
    row.overload.textContent=at===null?'':`⊓ overload ${new Date(at).toLocaleTimeString()}`;
  });
}
const scopeScreen={key:'scope',title:'Scope',make(m){
  this.rows=null;
  if(!state.whole.can.stream){this.at=m.appendChild(el('div'));return}
  this.note=m.appendChild(el('p',{className:'say'}));
  this.host=m.appendChild(el('div',{className:'scope',tabIndex:0,on:{keydown:e=>{
    const by={'+':.5,'-':2}[e.key];
    if(e.key==='0')scope.span=4;else if(by)scope.span=Math.max(.25,Math.min(16,scope.span*by));else return;
    e.preventDefault();e.stopPropagation();this.say();drawScope();
  }}}));
  this.say();
},say(){
  this.note.textContent=`The last ${scope.span} s of the stream: smallest and largest value of each short stretch. + and − change the time shown. Grey: frames that this page missed (${scope.missed} so far); red: scans that the link lost.`;
},show(kind){
  const w=state.whole,stream=w.now.stream;
  if(!w.can.stream){const h=latest();if(h)picture(this.at,`/api/records/${h.record}/channels`);else this.at.replaceChildren(el('p',{className:'absent'},'No hits yet.'));return}
  if(!stream){this.host.replaceChildren(el('p',{className:'absent'},'No stream yet.'));return}
  if(this.rows?.length!==stream.channels.length){
    this.rows=stream.channels.map(c=>{
      const row={canvas:el('canvas',{role:'img','aria-label':c.name+': smallest and largest value over time'}),numbers:el('span'),overload:el('b'),range:el('span',{className:'range'})};
      row.element=el('div',{className:'trace'},el('p',{},el('b',{},c.name),' ',row.numbers,' ',row.overload,' ',row.range),row.canvas);
      return row;
    });
    this.host.replaceChildren(...this.rows.map(r=>r.element));
  }
  this.say();
  scopeNumbers(this.rows);
  drawScope();
}};
